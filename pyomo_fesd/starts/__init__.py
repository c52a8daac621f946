"""Start values of a transformed model from a trajectory: a table on physical time, or the solution of another model.

Read ``start_from`` first, then ``time_table`` (the checked table and its values between rows), ``element_placement`` (lengths of
the elements), ``held_controls``, ``boundary_values`` (state jumps and hysteresis) and ``consistent_values`` (what follows from the
values that the table gives).  ``refine`` places its elements with the same functions.
"""

from pyomo_fesd.starts.element_placement import set_within_bounds
from pyomo_fesd.starts.start_from import start_from
