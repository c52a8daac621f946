"""Read Disjunctions over time: their modes, the regions and the equations of each mode, and the logic between them.

Read ``disjunction_tree.py`` (nested Disjunctions become modes), ``logic.py`` and ``exclusions.py`` (combinations of modes that
are excluded), ``system.py`` (one Disjunction at one time), and behind it ``regions.py`` with ``sampled_functions.py``,
``sign_patterns.py`` and ``sign_implicants.py`` (inequalities become switching functions and signs), ``mode_equations.py`` with
``defined_variables.py`` and ``linear_equations.py`` (equalities become right-hand sides), ``mode_domains.py`` with
``restricted_functions.py`` (laws that have a value in the region of their mode only); ``mode_contents.py`` and
``lists_of_times.py`` refuse the rest.  Nothing on the model changes here.
"""

from pyomo_fesd.dcs.reading.disjunction_tree import DisjunctionTree, Mode, Nesting, enclosing_disjunct
from pyomo_fesd.dcs.reading.exclusions import read_exclusions
from pyomo_fesd.dcs.reading.lists_of_times import refuse_lists_of_times
from pyomo_fesd.dcs.reading.logic import modes_left, read_logic
from pyomo_fesd.dcs.reading.mode_contents import refuse_twice_defined
from pyomo_fesd.dcs.reading.mode_equations import ModeEquations
from pyomo_fesd.dcs.reading.restricted_functions import arguments_of, factors_of, split
from pyomo_fesd.dcs.reading.sign_implicants import not_covered_once
from pyomo_fesd.dcs.reading.system import Analyses, HysteresisSystem, ModeSystem, RecognisedSystem, SystemReader
