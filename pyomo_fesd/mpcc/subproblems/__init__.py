"""Subproblems of an MPCC, each built from its compiled functions.

Read in this order: ``active_set`` (which side of a pair is zero), ``side_constraints`` (sides that need a row), ``relaxation``
(Reg(eps) in all its forms), ``branch`` (the NLP with one side of each pair at zero) with what gives it an interior
(``impact_sides``, ``single_rows``, ``differences``) and what solves it near a relaxation (``newton``), ``restoration`` (the least
violation), ``lpec`` (the linearised MPCC) with ``linear_program`` (HiGHS), ``descent`` (a measure free of units), ``binaries`` (to
suggest a branch), and ``pair_search`` with ``pair_program`` and ``repeated_program`` (to prove that none descends),
``stationarity`` (the certificate), ``insertion`` (whether a part inserted into a point may grow) with ``parts``, ``inserted_part``,
``inserted_copy``, ``joined_lpec`` and ``verdict``, ``end_insertion`` (the same at an end) with ``end_values``, ``solver_cache``
(NLP solvers kept for later runs). A new relaxation is a function in ``relaxation.FORMS``.
"""

from pyomo_fesd.mpcc.subproblems.active_set import FREE, G_ZERO, H_ZERO, ActiveSets, active_sets
from pyomo_fesd.mpcc.subproblems.branch import Branch
from pyomo_fesd.mpcc.subproblems.end_insertion import EndInsertions
from pyomo_fesd.mpcc.subproblems.end_values import EndInsertion
from pyomo_fesd.mpcc.subproblems.inserted_copy import Insertion
from pyomo_fesd.mpcc.subproblems.insertion import Insertions
from pyomo_fesd.mpcc.subproblems.lpec import MATTERS, Lpec
from pyomo_fesd.mpcc.subproblems.parts import Parts
from pyomo_fesd.mpcc.subproblems.relaxation import RELAXATIONS
from pyomo_fesd.mpcc.subproblems.restoration import Restoration
from pyomo_fesd.mpcc.subproblems.side_constraints import settle, sort_sides, without_constant
from pyomo_fesd.mpcc.subproblems.solver_cache import SolverCache
from pyomo_fesd.mpcc.subproblems.stationarity import Certificate, Stationarity, certify_point, measure
from pyomo_fesd.mpcc.subproblems.verdict import Verdict, of_orders
