"""The closed loop: a plant with drift that the model does not have still reaches the goal, and the table says how."""

import pyomo.environ as pyo
import pytest

from pyomo_fesd import Controller, Plant, receding_horizon
from tests.problems import controlled_ramp


def test_the_loop_reaches_its_goal_despite_of_mismatch_and_a_changing_reference():
    problem, real = controlled_ramp.control_problem(), controlled_ramp.build(stages=1, elements=6, drift=0.1)
    controller, plant = Controller(problem, [problem.u], [problem.goal], rise=0.1), Plant(real, [real.u])

    def before(number):
        problem.goal = 0.5 if number < 6 else -0.5

    table = receding_horizon(controller, plant, 14, before, time_limit=20)
    assert (table['origin'] != 'plan').all() and list(table.index) == pytest.approx([0.5 * k for k in range(14)])
    x = plant.trajectory()['x']
    assert x[x.index <= 3.0].iloc[-1] == pytest.approx(0.5, abs=0.15) and x.iloc[-1] == pytest.approx(-0.5, abs=0.15)
    assert {'origin', 'seconds', 'u'} <= set(table.columns) and pyo.value(problem.goal) == -0.5
