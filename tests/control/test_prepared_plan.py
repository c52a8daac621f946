"""Corrections of prepared plans: equal to the full solve up to second order, refused where the branch would change."""

import mpc_tank
import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd import Controller, FesdError
from tests.problems import controlled_ramp

TIMES = (0.5, 1.0, 1.5, 2.0)


def prepared(x=-1.6, **options):
    """Controller whose plan is prepared for the state x + 1: the first control is at its bound 2."""
    m = controlled_ramp.control_problem(**options)
    controller = Controller(m, [m.u], [m.goal, m.drift])
    controller.step({m.x: x})
    controller.prepare()
    return m, controller


def solved_from(m, **values):
    """The same problem solved from the values of ``m``."""
    other = controlled_ramp.control_problem()
    for v, kept in zip(other.component_data_objects(pyo.Var), m.component_data_objects(pyo.Var)):
        v.set_value(kept.value)
    other.goal = values.get('goal', 0.5)
    results = pyo.SolverFactory('mpec_hybrid').solve(other, warm_start=True)
    assert results.solver.stationarity == 'B'
    return other


@pytest.mark.parametrize('change', [0.2, -0.05, 0.01])
def test_with_linear_dynamics_within_a_branch_the_correction_is_the_solution(change):
    m, controller = prepared(-2.2)
    assert m.x[0].value == pytest.approx(-1.2)
    m.goal = 0.5 + change
    answer = controller.step({m.x: -1.2 + change})
    assert (answer.origin, answer.certified, answer.results) == ('correction', False, [])
    assert 'to first order' in answer.reason and m.x[0].value == -1.2 + change
    other = solved_from(m, goal=0.5 + change)
    assert [m.u[t].value for t in TIMES] == pytest.approx([other.u[t].value for t in TIMES], abs=1e-8)
    assert answer.objective == pytest.approx(pyo.value(other.cost), abs=1e-8)
    assert answer.controls.get_data_from_key(m.u) == pytest.approx(m.u[0.5].value)


def tank_after(change):
    """Valve of the tank after a correction by a part of the measured gas, and after a full solve; and the origin."""
    m = mpc_tank.control_problem()
    controller = mpc_tank.control(m, levels=None)
    controller.step()
    controller.prepare()
    measured = {m.M_G: m.M_G[0].value * (1 + change), m.M_L: m.M_L[0].value}
    answer = controller.step(measured)
    stages = [mpc_tank.INTERVAL * k for k in range(1, mpc_tank.STAGES + 1)]
    corrected = [m.u[t].value for t in stages]
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B'
    return max(abs(a - m.u[t].value) for a, t in zip(corrected, stages)), answer.origin


def test_the_error_of_a_correction_is_of_second_order():
    errors, origins = zip(*(tank_after(change) for change in (4e-3, 2e-3, 1e-3)))
    assert set(origins) == {'correction'}
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.25) and errors[1] / errors[2] == pytest.approx(4, rel=0.25)
    assert errors[2] < 1e-4


@pytest.mark.parametrize('measured', [0.2, 0.01])
def test_a_measurement_in_another_branch_is_solved(measured):
    m, controller = prepared()
    assert m.x[0].value == pytest.approx(-0.6)
    answer = controller.step({m.x: measured})
    assert answer.certified and answer.origin != 'correction'
    assert 'not corrected' in answer.reason and 'leave the branch' in answer.reason


def test_a_prediction_on_a_surface_has_no_derivative_and_is_solved():
    m, controller = prepared(-1.0)
    assert m.x[0].value == pytest.approx(0, abs=1e-8)
    answer = controller.step({m.x: -0.1})
    assert answer.certified and 'not corrected: x[0.0]: the solution has no derivative' in answer.reason


def test_controls_are_cut_to_bounds_that_have_changed():
    m, controller = prepared()
    m.u.setub(0.7)
    answer = controller.step({m.x: -0.6})
    assert answer.origin == 'correction'
    assert answer.controls.get_data_from_key(m.u) == 0.7 and max(m.u[t].value for t in TIMES) <= 0.7


def test_other_variables_refuse_to_leave_their_bounds():
    m, controller = prepared()
    m.x[2.0].setub(m.x[2.0].value - 0.05)
    answer = controller.step({m.x: -0.6})
    assert answer.certified and 'not corrected: x[2' in answer.reason and m.x[2.0].value <= m.x[2.0].ub + 1e-6


def test_another_mode_with_hysteresis_is_solved():
    m, controller = prepared(-2.2, relay=True, elements=4)
    (predicted,) = controller.interface.modes_at_first_time()
    (other,) = {'heating', 'cooling'} - {predicted}
    answer = controller.step({m.x: -1.2, m.y: 1.0}, modes=[other])
    assert answer.certified and 'another mode with hysteresis' in answer.reason
    assert controller.interface.modes_at_first_time() == [other]


def test_a_prepared_plan_is_moved_once_and_used_once():
    m, controller = prepared()
    controller.step({m.x: -0.6})
    planned = m.u[1.0].value
    answer = controller.step(time_limit=1e-9)
    assert answer.origin == 'plan' and answer.controls.get_data_from_key(m.u) == pytest.approx(planned)


def test_a_preparation_without_a_certificate_is_no_plan_to_correct():
    m = controlled_ramp.control_problem()
    controller = Controller(m, [m.u], [m.goal])
    controller.step({m.x: -1.6})
    assert controller.prepare(time_limit=1e-9).origin == 'plan'
    answer = controller.step({m.x: -0.5})
    assert answer.certified and 'not corrected: the plan before goes on' in answer.reason


def test_a_thorough_step_solves_a_prepared_plan_too():
    m, controller = prepared()
    assert controller.step({m.x: -0.6}, thorough=True).certified


def test_changes_that_are_no_parameters_are_refused_and_leave_the_prepared_plan():
    m = controlled_ramp.control_problem()
    controller = Controller(m, [m.u])
    controller.step({m.x: -1.6})
    controller.prepare()
    before = [v.value for v in m.component_data_objects(pyo.Var)]
    m.goal = 0.8
    with pytest.raises(FesdError, match='goal.*was compiled into the model'):
        controller.step({m.x: -0.5})
    assert [v.value for v in m.component_data_objects(pyo.Var)] == before
    m.goal = 0.5
    assert controller.step({m.x: -0.6}).origin == 'correction'


def test_a_loop_with_advanced_steps_reaches_its_goal():
    problem, real = controlled_ramp.control_problem(), controlled_ramp.build(stages=1, elements=6, drift=0.1)
    controller, plant = Controller(problem, [problem.u], [problem.goal]), pyomo_fesd.Plant(real, [real.u])
    table = pyomo_fesd.receding_horizon(controller, plant, 8, time_limit=20, advanced=True)
    assert 'correction' in set(table['origin']) and (table['origin'] != 'plan').all()
    assert (table['prepared'] > 0).all() and plant.trajectory()['x'].iloc[-1] == pytest.approx(0.5, abs=0.15)


def test_a_plan_that_is_prepared_twice_is_moved_once():
    m, controller = prepared()
    planned = m.u[1.0].value
    assert controller.prepare().certified and m.x[0].value == pytest.approx(-0.6)
    assert m.u[1.0].value == pytest.approx(planned)
    assert controller.step({m.x: -0.6}).origin == 'correction'
