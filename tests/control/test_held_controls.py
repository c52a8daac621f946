"""Held controls as starts: no plan gets worse by them, the best is found, controls without bounds are refused."""

import mpc_heater
import pyomo.environ as pyo
import pytest

from pyomo_fesd import Controller, FesdError, simulate
from pyomo_fesd.control.held_controls import HeldControls
from tests.problems import controlled_ramp


def test_levels_never_make_the_plan_worse_and_hold_within_a_deadline():
    for x, goal in ((-1.0, 0.5), (0.3, -0.5), (-0.1, 1.0)):
        objectives = []
        for levels in (None, 4):
            m = controlled_ramp.control_problem()
            m.goal = goal
            objectives.append(Controller(m, [m.u], [m.goal], levels=levels).step({m.x: x}).objective)
        assert objectives[1] <= objectives[0] + 1e-9
    m = controlled_ramp.control_problem()
    assert Controller(m, [m.u], [m.goal], levels=4).step(time_limit=0).origin == 'plan'


def test_the_best_level_is_that_of_simulations_one_by_one():
    m = controlled_ramp.control_problem()
    objective, level = HeldControls(m, [m.u], m.t, 5).best(m.cost)
    found = []
    for k in range(5):
        for t in m.t:
            m.u[t].set_value(-2 + k)
        simulate(m, m.t, inputs=[m.u])
        found.append(pyo.value(m.cost))
    assert objective == pytest.approx(min(found)) and level == found.index(min(found)) / 4


def test_one_level_and_controls_without_bounds_are_refused():
    m = controlled_ramp.control_problem()
    with pytest.raises(FesdError, match='give at least 2'):
        Controller(m, [m.u], levels=1)
    m.u.setub(None)
    with pytest.raises(FesdError, match='needs? a lower and an upper bound'):
        Controller(m, [m.u], levels=3)


def test_the_heater_closes_its_loop():
    real, steps = mpc_heater.loop(steps=3)
    assert len(steps) == 3 and (steps['origin'] != 'plan').all()
    y = real.trajectory()['y']
    assert y.between(50, 62).all() and y.index[-1] == pytest.approx(3 * mpc_heater.INTERVAL)
