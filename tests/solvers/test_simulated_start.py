"""Where nothing is free ``mpec_hybrid`` simulates first, and the simulated values are the answer."""

import io

import bouncing_ball
import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import thermostat
from problems import laws, parts, two_carts
from problems.running import move
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.contrib.solver.common.results import SolutionStatus

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.mpcc.algorithm import hybrid
from pyomo_fesd.mpcc.nlp.deadline import Deadline
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


@pytest.mark.parametrize('distance', [0.0, 1e-16, -1e-13, 1e-11, -1e-9, 1e-7])
@pytest.mark.parametrize('rates', [(1.0, -0.7), (-1.0, 0.7)], ids=['attracts', 'repels'])
def test_a_start_on_the_surface_or_near_it(rates, distance):
    random = np.random.default_rng(1)
    weights, x0 = random.uniform(-1, 1, 2), random.uniform(-1, 1, 2)
    m = planar(weights, x0 + distance * weights, float(weights @ x0), rates)
    results, _ = solve(m)
    assert results.solution_status is SolutionStatus.optimal
    assert results.extra_info.nlps <= 1


def planar(weights, x0, level, rates):
    """Two states; their rates depend on the side of a line, along ``weights``."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.i = pyo.RangeSet(0, 1)
    m.x = pyo.Var(m.t, m.i, initialize=lambda m, t, i: x0[i])
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i in m.i:
        m.x[0, i].fix()

    @m.Disjunction(m.t)
    def side(m, t):
        c = sum(weights[i] * m.x[t, i] for i in m.i)
        ode = [[m.dx[t, i] == rate * weights[i] - 0.1 * m.x[t, i] for i in m.i] for rate in rates]
        return [[c <= level, *ode[0]], [c >= level, *ode[1]]]

    return move(dcs(m), 4, 2)


def test_the_reason_names_what_a_start_violates(monkeypatch):
    def wrong(model, *args):
        for t in model.t:
            model.x[t].set_value(7.0)
        return True

    monkeypatch.setattr(simulated_start, '_registered', [wrong])
    m = move(dcs(still()), 4, 2)
    m.impossible = pyo.Constraint(expr=m.x[2] == 50)
    results, log = solve(m, raise_exception_on_nonoptimal_result=False, load_solutions=False)
    assert results.solution_status is not SolutionStatus.optimal
    for text in (log, results.extra_info.reason):
        assert "not accepted" in text and "is violated by" in text
    assert 'largest violations: ' in results.extra_info.reason


# Where the homotopy finds nothing


def pushed_ball(target=0.5):
    """A ball whose gravity is chosen so that it is at a height at the end; the homotopy finds no branch with two impacts."""
    m = bouncing_ball.build(1.0, 2)
    m.u = pyo.Var(bounds=(-2, 2), initialize=0)
    m.fall.deactivate()
    m.pushed_fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -bouncing_ball.GRAVITY + m.u)
    m.cost = pyo.Objective(expr=(m.q[2] - target) ** 2 + 1e-3 * m.u**2)
    return move(m, 8, 2)


@pytest.fixture
def without_completions(monkeypatch):
    monkeypatch.setattr(simulated_start.SimulatedStart, 'completion', lambda self, compiled: None)


def test_a_homotopy_without_a_point_begins_again_at_a_simulation(without_completions):
    m = pushed_ball()
    results, log = solve(m)
    assert 'no feasible point, so simulated' in log
    assert results.extra_info.stationarity == 'B'
    assert len(times(m)) == 2 and m.u.value == pytest.approx(1.28241, abs=1e-3)


def test_it_does_so_before_the_time_is_up(monkeypatch, without_completions):
    monkeypatch.setattr(hybrid, 'PATIENCE', 0.0)
    results, log = solve(pushed_ball(), time_limit=30)
    assert 'relaxation' not in log.split('no feasible point, so simulated')[0]
    assert results.extra_info.stationarity == 'B'


def test_a_path_that_paused_goes_on(monkeypatch):
    monkeypatch.setattr(hybrid, 'PATIENCE', 0.0)
    monkeypatch.setattr(simulated_start, '_registered', [lambda m, demanded, *args: demanded and fail(m)])
    m = move(dcs(still(True)), 4, 2)
    results, log = solve(m, time_limit=30)
    assert 'without success: t: simulate: it cannot go on' in log
    assert results.extra_info.stationarity == 'B' and times(m) == pytest.approx([2 / 3], abs=1e-6)


def test_where_nothing_helps_the_reason_says_what_each_saw(monkeypatch):
    monkeypatch.setattr(simulated_start, '_registered', [lambda m, demanded, *args: demanded and fail(m)])
    m = move(dcs(still(True)), 4, 2)
    m.impossible = pyo.Constraint(expr=m.x[2] == 50)
    before = [v.value for v in m.component_data_objects(pyo.Var)]
    results, _ = solve(m, raise_exception_on_nonoptimal_result=False, load_solutions=False)
    reason = results.extra_info.reason
    assert 'largest violations: ' in reason and 'simulate: it cannot go on' in reason
    assert [v.value for v in m.component_data_objects(pyo.Var)] == before


def test_the_older_interface_has_the_same_sentences():
    m = move(bouncing_ball.build(1.0, 3), 2, 2)
    message = pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=20).solver.message
    assert 'without success' in message and 'largest violations: ' in message


def test_values_that_are_not_loaded_leave_the_model_alone():
    m = move(dcs(still()), 4, 2)
    before = [v.value for v in m.component_data_objects(pyo.Var)]
    results, _ = solve(m, load_solutions=False)
    assert [v.value for v in m.component_data_objects(pyo.Var)] == before
    results.solution_loader.load_vars()
    assert times(m) == pytest.approx([2 / 3], abs=1e-6)


def fail(model, *args):
    """A simulation that fails."""
    model.x[2].set_value(99.0)
    raise FesdError('t', "simulate: it cannot go on", "take another model")


def test_a_failure_of_the_simulation_is_no_failure(monkeypatch):
    monkeypatch.setattr(simulated_start, '_registered', [fail])
    m = move(dcs(still()), 4, 2)
    results, log = solve(m)
    assert 'without success: t: simulate: it cannot go on' in log
    assert results.solution_status is SolutionStatus.optimal
    assert times(m) == pytest.approx([2 / 3], abs=1e-6)


def test_a_march_whose_elements_cannot_be_even_is_a_solution():
    # the tank is empty at t = 2, where its outflow has an infinite slope: the elements beside it end where the march put them
    case = laws.torricelli()
    m = case.model
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=10, ncp=3)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    pyo.assert_optimal_termination(results)
    assert results.solver.nlps <= 1 and results.solver.violation <= 1e-12
    assert case.found() == pytest.approx(case.exact, abs=1e-12)


def test_a_push_is_found_from_a_start_at_which_nothing_touches():
    m = two_carts.build(4, 2)
    results, log = solve(m)
    assert results.extra_info.stationarity == 'B'
    assert 'its controls simulated' in log
    assert pyo.value(m.cost) < 0.1 * two_carts.UNTOUCHED
    controls = [m.u[two_carts.END * (k + 1) / 4].value for k in range(4)]
    assert pyo.value(m.cost) == pytest.approx(two_carts.replay(controls), abs=1e-4)


def test_without_simulations_the_homotopy_runs_as_it_is():
    _, log = solve(two_carts.build(4, 2), simulate_first=False, raise_exception_on_nonoptimal_result=False)
    assert 'simulated' not in log


def test_a_completion_leaves_the_model_as_it_was():
    m = two_carts.build(4, 2)
    compiled = parts.compiled(m)
    config = SolverFactoryV2('mpec_hybrid').config
    config.timer = HierarchicalTimer()
    start = simulated_start.SimulatedStart(m, config, Deadline())
    before = [(v.value, v.stale) for v in m.component_data_objects(pyo.Var)]
    w, is_complete, _ = start.completion(compiled)(compiled.x0, 10.0)
    assert is_complete
    assert np.abs(np.minimum(compiled.evaluate(w).G, compiled.evaluate(w).H)).max() < 1e-9
    assert [(v.value, v.stale) for v in m.component_data_objects(pyo.Var)] == before


def test_a_completion_fails_rather_than_that_it_searches_for_long(monkeypatch):
    m, asked = two_carts.build(4, 2), []
    compiled = parts.compiled(m)
    config = SolverFactoryV2('mpec_hybrid').config
    config.timer = HierarchicalTimer()
    monkeypatch.setattr(simulated_start, '_registered', [lambda model, demanded, quick, *args: asked.append((demanded, quick))])
    start = simulated_start.SimulatedStart(m, config, Deadline())
    start.completion(compiled)(compiled.x0, 10.0)
    assert asked == [(False, False), (True, True)]
