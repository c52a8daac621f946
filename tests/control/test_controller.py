"""Steps of predictive control: answers from the branch and otherwise, what may change, and a deadline for everything."""

import time

import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd import Controller, FesdError
from tests.problems import controlled_ramp


@pytest.fixture
def controller():
    m = controlled_ramp.control_problem()
    return Controller(m, [m.u], [m.goal, m.drift])


def solved_anew(x, goal, bound=2.0):
    """Objective of the same problem without any plan, from a simulation."""
    m = controlled_ramp.control_problem()
    m.x[0].fix(x)
    m.goal = goal
    m.u.setub(bound)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, simulate_first=True)
    assert results.solver.stationarity == 'B'
    return pyo.value(m.cost)


def test_plans_are_simulations_of_their_controls_while_references_bounds_and_states_change(controller):
    m = controller._model
    origins = []
    for x, goal, bound in (
        (-1.0, 0.5, 2.0),
        (-0.6, 0.5, 2.0),
        (-0.2, 0.5, 1.5),
        (0.0, 0.7, 1.5),
        (0.3, -0.5, 1.5),
        (-0.1, -0.5, 2.0),
    ):
        m.goal = goal
        m.u.setub(bound)
        answer = controller.step({'x[*]': x}, time_limit=20)
        origins.append(answer.origin)
        assert answer.origin != 'plan' and max(v.value for v in m.u.values()) <= bound + 1e-9
        assert answer.controls.get_data_from_key(m.u) == pytest.approx(m.u[0.5].value) and m.x[0].value == x
        other = controlled_ramp.control_problem()
        other.x[0].fix(x)
        for t in (0.5, 1.0, 1.5, 2.0):
            other.u[t].set_value(m.u[t].value)
        pyomo_fesd.simulate(other)
        assert [m.x[t].value for t in (0.5, 1.0, 1.5, 2.0)] == pytest.approx([other.x[t].value for t in (0.5, 1, 1.5, 2)], abs=1e-6)
    assert 'branch' in origins


@pytest.mark.parametrize('x', [0.0, 1e-12, -1e-12])
def test_a_measurement_exactly_on_a_surface_has_an_answer_and_a_thorough_step_the_best(controller, x):
    controller.step()
    answer = controller.step({'x[*]': x}, time_limit=30, thorough=True)
    assert answer.certified and answer.objective <= solved_anew(x, 0.5) + 1e-6


def test_an_infeasible_bound_keeps_the_plan_and_the_next_steps_recover(controller):
    m = controller._model
    controller.step()
    planned = m.u[1.0].value
    m.wall = pyo.Param(initialize=0)
    m.x[0.5].setub(-5)
    answer = controller.step({'x[*]': -0.5}, time_limit=20)
    assert (answer.origin, answer.certified, answer.objective) == ('plan', False, None)
    assert 'the plan before goes on' in answer.reason
    assert answer.controls.get_data_from_key(m.u) == pytest.approx(planned)
    m.x[0.5].setub(None)
    answer = controller.step({'x[*]': -0.2})
    assert answer.certified and m.x[0].value == -0.2


@pytest.mark.parametrize('seconds', [1e-9, 1e-3, 5e-3])
def test_a_deadline_too_short_for_any_solve_keeps_the_plan(controller, seconds):
    m = controller._model
    controller.step()
    planned, began = m.u[1.0].value, time.perf_counter()
    answer = controller.step({'x[*]': -0.5}, time_limit=seconds)
    assert time.perf_counter() - began < 2.0
    assert answer.origin in ('plan', 'deadline', 'branch')
    if answer.origin == 'plan':
        assert answer.controls.get_data_from_key(m.u) == pytest.approx(planned)
    assert controller.step({'x[*]': -0.2}).certified


def test_a_plan_outside_of_new_bounds_is_cut(controller):
    m = controller._model
    controller.step()
    m.u.setub(0.25)
    answer = controller.step({'x[*]': -0.5}, time_limit=1e-9)
    assert answer.origin == 'plan' and answer.controls.get_data_from_key(m.u) <= 0.25


def test_without_a_plan_and_without_time_the_initial_values_are_the_answer(controller):
    answer = controller.step(time_limit=1e-9)
    assert answer.origin == 'plan' and answer.controls.get_data_from_key(controller._model.u) == 1.0
    assert controller.step().certified


def test_a_parameter_that_is_not_listed_is_named():
    m = controlled_ramp.control_problem()
    controller = Controller(m, [m.u])
    controller.step()
    m.goal = 0.8
    before = [v.value for v in m.component_data_objects(pyo.Var)]
    with pytest.raises(FesdError, match="goal.*was compiled into the model"):
        controller.step({'x[*]': -0.5})
    assert [v.value for v in m.component_data_objects(pyo.Var)] == before


def test_a_plan_whose_objective_rises_is_compared_with_the_homotopy():
    m = controlled_ramp.control_problem()
    controller = Controller(m, [m.u], rise=0.1)
    controller.step({'x[*]': 0.0})
    answer = controller.step({'x[*]': -1.0}, time_limit=60)
    assert any(step.kind == 'relaxation' for results in answer.results for step in results.extra_info.steps)
    assert answer.certified and answer.objective <= solved_anew(-1.0, 0.5) + 1e-6


def test_controls_must_be_variables_over_time():
    m = controlled_ramp.control_problem()
    with pytest.raises(FesdError, match="Controller: not a Var over 't'"):
        Controller(m, [m.goal])


def test_a_row_has_everything_but_the_results(controller):
    row = controller.step().row()
    assert set(row) == {'origin', 'certified', 'reason', 'objective', 'seconds', 'u'}


def test_nothing_is_compiled_again(controller, monkeypatch):
    controller.step()
    from pyomo_fesd.solvers import mpec_hybrid

    monkeypatch.setattr(mpec_hybrid, 'PersistentModel', None)
    assert controller.step({'x[*]': -0.6}).certified
    assert pyomo_fesd.ControlStep is type(controller.step({'x[*]': -0.3}))
