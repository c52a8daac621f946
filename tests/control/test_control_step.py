"""The answer of a step as a row of a table."""

from pyomo.contrib.mpc import ScalarData

from pyomo_fesd import ControlStep
from pyomo_fesd.control.control_step import PLAN


def test_a_row_names_controls_without_time():
    row = ControlStep(ScalarData({'u[*]': 2.0, 'b.v[*,a]': 3.0}), PLAN, False, 'why', None, 0.1).row()
    assert (row['u'], row['b.v[a]'], row['origin'], row['objective']) == (2.0, 3.0, 'plan', None) and 'results' not in row
