"""Where no step is found, the error says how long a step the equations allow."""

import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer

from pyomo_fesd import FesdError, simulate
from pyomo_fesd.core import TimeIndex
from pyomo_fesd.mpcc import Deadline
from pyomo_fesd.simulation.passes import Simulation
from tests.models import scalar_ode
from tests.problems.running import move


def with_an_end(end):
    """dx/dt = x^2 up to a time."""
    m = scalar_ode(x0=1.0, end=end)
    m.y[0].fix(0.0)
    m.leaves = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.x[t] ** 2)
    m.rests = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    return m


def test_a_solution_that_ends_within_a_step_is_followed_to_its_end():
    """x = 1 + h x^2, one point of Radau's scheme for dx/dt = x^2, has a solution up to h = 1/4."""
    m = with_an_end(2000)
    with pytest.raises(FesdError, match=r'no step of length 2000 was found from time 0: .* solved up to a length of 0\.2[45]'):
        simulate(move(m, 1, 1))


def test_a_step_that_is_short_enough_is_found():
    m = with_an_end(0.2)
    simulate(move(m, 1, 1))
    assert m.x[0.2].value == pytest.approx((1 - (1 - 0.8) ** 0.5) / 0.4)


def test_a_simulation_that_is_only_a_start_does_not_look_for_a_step():
    m = move(with_an_end(2000), 1, 1)
    with pytest.raises(FesdError, match='no step was found from time 0 at once'):
        Simulation(m, TimeIndex(m.t), [], {}, HierarchicalTimer(), Deadline(), quick=True).run()
