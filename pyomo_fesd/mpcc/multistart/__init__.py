"""Several starts of one MPCC: ``Multistart(setup).solve()`` returns the ``Run`` of the best one.

Read in this order: ``multistart`` (the loop, here or in an executor), ``start_job`` (one start, also in a worker process),
``best_start`` (the ranking).
"""

from pyomo_fesd.mpcc.multistart.multistart import Multistart
