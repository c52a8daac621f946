"""Where nothing is free ``mpec_hybrid`` simulates first, and the simulated values are the answer."""

import io

import bouncing_ball
import pyomo.environ as pyo
import pytest
import thermostat
from problems.running import move
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.contrib.solver.common.results import SolutionStatus

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.solvers import simulated_start
from tests.models import dcs, signum


def heated(hours, nfe):
    m = thermostat.room(hours)
    return move(dcs(thermostat.add_heater(m), hysteresis=[m]), nfe, 2)


def solve(m, **options):
    log = io.StringIO()
    return SolverFactoryV2('mpec_hybrid').solve(m, tee=log, **options), log.getvalue()


def times(m):
    return [s.time for s in pyomo_fesd.switches(m)]


def test_hysteresis():
    m = heated(2, 14)
    results, log = solve(m)
    assert times(m) == pytest.approx(thermostat.switching_times(2), abs=1e-6)
    assert results.solution_status is SolutionStatus.optimal and results.extra_info.nlps == 0
    assert 'simulated first' in log.splitlines()[0]


def test_state_jumps():
    m = move(bouncing_ball.build(1.0, 2), 8, 2)
    results, _ = solve(m)
    assert times(m) == pytest.approx(bouncing_ball.impacts(1.0, 2), abs=1e-6)
    assert results.extra_info.nlps == 0


def test_the_option_turns_it_off(monkeypatch):
    monkeypatch.setattr(simulated_start, '_registered', [lambda *args: pytest.fail("simulated")])
    _, log = solve(move(dcs(still()), 4, 2), simulate_first=False)
    assert 'simulated' not in log


def still(objective=False):
    m = signum()
    m.y[0].fix(1.0)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    if objective:
        m.cost = pyo.Objective(expr=m.x[2] ** 2)
    return m


def test_with_an_objective_that_nothing_can_change():
    m = move(dcs(still(True)), 4, 2)
    assert 'simulated' not in solve(m, load_solutions=False)[1]
    results, log = solve(m, simulate_first=True)
    assert 'the values are the start' in log
    assert results.extra_info.stationarity == 'B'
    assert times(m) == pytest.approx([2 / 3], abs=1e-6)


def test_a_control_with_an_objective_is_the_homotopys():
    m = still(True)
    m.u = pyo.Var(m.t, bounds=(0, 1), initialize=0.5)
    m.rest.deactivate()
    m.moved = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.u[t])
    move(dcs(m), 4, 2, piecewise_constant=[m.u])
    _, log = solve(m)
    assert 'simulated' not in log
    _, log = solve(m, simulate_first=True)
    assert 'the values are the start' in log


def test_where_both_fail_the_reason_says_what_each_saw():
    m = move(bouncing_ball.build(1.0, 3), 2, 2)
    before = [v.value for v in m.component_data_objects(pyo.Var)]
    results, log = solve(m, time_limit=20, raise_exception_on_nonoptimal_result=False, load_solutions=False)
    assert results.solution_status is not SolutionStatus.optimal
    assert 'without success' in log and 'used up' in results.extra_info.reason
    assert [v.value for v in m.component_data_objects(pyo.Var)] == before


def test_values_that_are_not_loaded_leave_the_model_alone():
    m = move(dcs(still()), 4, 2)
    before = [v.value for v in m.component_data_objects(pyo.Var)]
    results, _ = solve(m, load_solutions=False)
    assert [v.value for v in m.component_data_objects(pyo.Var)] == before
    results.solution_loader.load_vars()
    assert times(m) == pytest.approx([2 / 3], abs=1e-6)


def test_a_failure_of_the_simulation_is_no_failure(monkeypatch):
    def fail(model, *args):
        model.x[2].set_value(99.0)
        raise FesdError('t', "simulate: it cannot go on", "take another model")

    monkeypatch.setattr(simulated_start, '_registered', [fail])
    m = move(dcs(still()), 4, 2)
    results, log = solve(m)
    assert 'without success: t: simulate: it cannot go on' in log
    assert results.solution_status is SolutionStatus.optimal
    assert times(m) == pytest.approx([2 / 3], abs=1e-6)
