"""States that are lost in the tolerances are named; those that are 0 to round-off are not."""

from types import SimpleNamespace

import numpy as np
import pyomo.environ as pyo
import pytest

from pyomo_fesd.solvers.small_states import warn_small_states
from tests.problems.running import transform
from tests.problems.states import over_time


@pytest.mark.parametrize(
    'value, size, said',
    [
        (1e-9, 1.0, True),
        (1e-3, 1e4, True),
        (1e-3, 1.0, False),
        (1e-9, 1e-9, False),
        (0.0, 1.0, False),
        (1.4e-48, 1.0, False),
        (1e-17, 1.0, False),
    ],
)
def test_values_far_below_the_size_by_which_they_were_scaled(value, size, said):
    m = over_time(1, x=0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 0)
    transform(m)
    m.x[...].set_value(value)
    compiled = SimpleNamespace(variables=list(m.x.values()), scale=SimpleNamespace(x=np.full(len(m.x), 1 / size)))
    messages = warn_small_states(m, compiled)
    assert [message.startswith('x: its values are at most') for message in messages] == [True] * said
