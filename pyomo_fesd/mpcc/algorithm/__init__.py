"""The hybrid active-set algorithm: ``HybridSolver(setup).solve()`` returns a ``Run``.

Read in this order: ``state`` (the records of a run), ``hybrid`` (the algorithm as a whole), ``homotopy`` (the path of relaxations)
with ``gap_test`` (when it may end) and ``recovery`` (when a relaxation fails), ``completions`` (rounds where points can be
completed), ``branches`` (which are solved, and descent) with ``branch_solutions`` (their NLPs) and ``neighbours`` (those beside a
point, in which changes have moved: ``moves``), ``evenness`` (the method's own variables shared evenly), ``coincidences`` (tries
every order of changes that fall together) with ``orders`` (which there are), ``insertions`` (places between), ``order_branches``
(their NLPs), ``arrivals`` (changes at an end) and ``short_places`` (beside places of least extent), ``search`` (depth first, as a
last resort), ``subsolves`` (limits, times and log of each NLP and LPEC), ``start_points``.
"""

from pyomo_fesd.mpcc.algorithm.branch_solutions import as_good
from pyomo_fesd.mpcc.algorithm.feasible_start import is_exact
from pyomo_fesd.mpcc.algorithm.hybrid import HybridSolver
from pyomo_fesd.mpcc.algorithm.start_points import start_point
from pyomo_fesd.mpcc.algorithm.state import Counts, LogEntry, Outcome, Run, Setup, Start, Stop, Tolerances
