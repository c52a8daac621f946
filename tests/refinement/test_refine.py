"""Accuracy control: the answer is within the tolerance, with few elements; errors leave the model as it was."""

import logging
from math import acos, exp, inf, log, nan

import bouncing_ball
import numpy as np
import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
import thermostat
from benchmarks.refinement import problems, run
from hypothesis import given
from hypothesis import strategies as st
from pyomo.gdp import Disjunction
from pyomo.opt import SolverFactory

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.refinement import round_solver as solver
from pyomo_fesd.refinement.dense_output import read_solution
from pyomo_fesd.refinement.element_density import GROWTH, DensePiece, expected, next_numbers
from pyomo_fesd.refinement.error_estimate import LEAST_ORDER, observed_order
from pyomo_fesd.refinement.interpolated_start import start_from
from pyomo_fesd.refinement.round_solver import RoundSolver
from pyomo_fesd.refinement.trial_round import trial_round
from tests.models import dcs, finite_elements, snapshot
from tests.problems import held_control, setpoint, simulations


def decay(points=(0, 1, 10), rate=5.0):
    """x' = -rate x from 1: all happens early."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    m.x = pyo.Var(m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -rate * m.x[t])
    return m


def remembered(horizon=thermostat.HORIZON):
    m = thermostat.build(horizon)
    return dcs(m, hysteresis=[m.relay])


# The tolerance


@pytest.mark.parametrize('name', problems.PROBLEMS)
def test_the_true_error_is_below_the_tolerance(name):
    found, error = run.refined(problems.PROBLEMS[name], 1e-6)
    assert found.reached and error <= 1e-6 and found.error <= 1e-6
    assert found.table['elements'].iloc[-1] <= 100


@pytest.mark.parametrize('name, tolerance', [('tank', 1e-8), ('thermostat', 1e-10)])
def test_more_digits(name, tolerance):
    found, error = run.refined(problems.PROBLEMS[name], tolerance)
    assert found.reached and error <= tolerance


@pytest.mark.parametrize('scheme, ncp, tolerance', [('LAGRANGE-RADAU', 2, 1e-2), ('LAGRANGE-LEGENDRE', 3, 1e-4)])
def test_schemes(scheme, ncp, tolerance):
    m = dcs(oscillator.build())
    assert pyomo_fesd.refine(m, tolerance, ncp=ncp, scheme=scheme).reached
    assert oscillator.error(m) <= tolerance


def test_an_answer_that_is_exact_takes_two_rounds():
    m = dcs(signum.build())
    found = pyomo_fesd.refine(m)
    assert len(found.table) == 2 and found.reached
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(2 / 3, abs=1e-9)


def test_without_anything_that_switches():
    m = decay((0, 1))
    assert pyomo_fesd.refine(m, 1e-9).reached
    assert m.x[1].value == pytest.approx(exp(-5), abs=1e-9)


def test_small_states_have_a_scale():
    m = decay((0, 1))
    m.x[...].set_value(1e-6)
    m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
    m.scaling_factor[m.x] = 1e6
    pyomo_fesd.refine(m, 1e-5)
    assert abs(m.x[1].value / 1e-6 - exp(-5)) <= 1e-5
    assert len(list(m.t)) > 3 * 8 + 1


# Where the elements go


def test_elements_go_where_something_happens():
    m = decay(rate=20.0)
    found = pyomo_fesd.refine(m, 1e-5)
    early = sum(1 for t in m.t.get_finite_elements() if t <= 1) - 1
    assert found.reached and early > 2 * (found.table['elements'].iloc[-1] - early)
    assert m.x[1].value == pytest.approx(exp(-20), abs=1e-5)


def relaxing(points):
    """x' = -50 x down to 1/10, then -x/2: a piece of 0.046, one element of any coarse grid, with the same error in each."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    m.x = pyo.Var(m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(1)
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] >= 0.1, m.dx[t] == -50 * m.x[t]], [m.x[t] <= 0.1, m.dx[t] == -m.x[t] / 2]])
    return dcs(m)


def test_a_piece_that_is_one_element_in_all_rounds_is_not_taken_for_exact():
    m = relaxing([0, 1])
    found = pyomo_fesd.refine(m, 1e-4, nfe=4, max_rounds=2)
    assert not found.reached and abs(pyomo_fesd.switches(m)[0].time - log(10) / 50) <= found.error


def test_a_point_behind_a_layer_is_placed_as_well_as_by_hand():
    elements = {}
    for points in ([0, 0.5], [0, 0.1, 0.5]):
        m = relaxing(points)
        found = pyomo_fesd.refine(m, 1e-4)
        assert found.reached and abs(pyomo_fesd.switches(m)[0].time - log(10) / 50) <= 1e-4
        elements[len(points)] = found.table['elements'].iloc[-1]
    assert elements[2] <= 2 * elements[3]


def test_named_quantities_alone_count():
    m = decay()
    late = pyomo_fesd.refine(m, 1e-5, quantities=m.x[10])
    assert late.reached and late.table['elements'].iloc[-1] < pyomo_fesd.refine(decay(), 1e-5).table['elements'].iloc[-1]
    assert m.x[10].value == pytest.approx(exp(-50), abs=1e-5)
    assert 'quantities' in late.table


def test_given_inputs_differ_from_stage_to_stage():
    m = dcs(setpoint.build_given())
    found = pyomo_fesd.refine(m, 1e-8, piecewise_constant=[m.p])
    assert found.reached and m.x[2].value == pytest.approx(setpoint.FINAL, abs=1e-8)


# Optimal control


def test_optimal_control_goes_on_from_the_round_before():
    m = dcs(held_control.build())
    found = pyomo_fesd.refine(m, 1e-8, piecewise_constant=[m.u])
    assert found.reached and str(found.results.solver.stationarity) == 'B'
    assert pyo.value(m.cost) == pytest.approx(held_control.VALUE, abs=1e-7)
    assert [m.u[1].value, m.u[2].value] == pytest.approx(held_control.CONTROLS, abs=1e-6)
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(held_control.SWITCH, abs=1e-7)
    assert 'objective' in found.table


def test_start_values_are_a_solution_where_the_grid_is_exact():
    m = dcs(held_control.build())
    read = []
    for numbers in ([3, 3], [4, 7]):
        with trial_round(m, m.t):
            finite_elements(m, nfe=numbers, ncp=3, piecewise_constant=[m.u])
            if read:
                start_from(m, m.t, read[0])
            results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=bool(read))
            read.append(read_solution(m, m.t, []))
            assert str(results.solver.stationarity) == 'B'
    # one branch, in two stages
    assert results.solver.nlps <= 2
    assert [p.modes for p in read[0].pieces] == [p.modes for p in read[1].pieces]


# Rounds


def test_too_few_elements_for_the_switches_are_a_round_without_a_solution():
    m = remembered()
    found = pyomo_fesd.refine(m, 1e-6, nfe=3)
    assert 'used up' in found.table['note'].iloc[0] and found.reached
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(thermostat.switching_times(), abs=1e-6)


def test_the_model_is_solved_and_the_table_describes_the_rounds(capsys):
    m = remembered()
    found = pyomo_fesd.refine(m, 1e-6, tee=True)
    last = found.table.iloc[-1]
    assert len(m.t) == 1 + 3 * sum(last['nfe']) and last['elements'] == sum(last['nfe'])
    assert last['pairs'] == pyomo_fesd.report(m)['pairs'] + pyomo_fesd.report(m)['decided']
    assert capsys.readouterr().out.count('\n') == 2 + len(found.table)
    assert str(found).count('\n') == 1 + len(found.table)
    assert len(pyomo_fesd.trajectory(m)) == len(m.t)
    assert pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True).solver.stationarity == 'B'


def test_a_tolerance_that_is_not_reached_gives_a_warning(caplog):
    m = dcs(oscillator.build())
    with caplog.at_level(logging.WARNING, 'pyomo_fesd'):
        found = pyomo_fesd.refine(m, 1e-12, max_rounds=2)
    assert not found.reached and 'not reached in 2 rounds' in caplog.text
    assert oscillator.error(m) <= found.error


def test_labels_end_a_refinement(caplog, monkeypatch):
    monkeypatch.setattr('pyomo_fesd.refinement.mesh.LEAST', 2e-3)
    m = decay((0, 1e-3), 5e3)
    found = pyomo_fesd.refine(m, 1e-14)
    assert not found.reached and found.table['elements'].iloc[-1] == found.table['elements'].max()
    assert m.x[1e-3].value == pytest.approx(exp(-5), abs=1e-8)


def test_warnings_come_once(caplog):
    m = decay()
    m.feed = pyo.Var(m.t, initialize=0)
    m.feed.fix()
    m.other = pyo.Constraint(m.t, rule=lambda m, t: m.feed[t] == 0)
    with caplog.at_level(logging.WARNING, 'pyomo_fesd'):
        pyomo_fesd.refine(m, 1e-4)
    assert caplog.text.count('fixed at every time') == 1


def test_the_last_solution_is_found_again_where_a_finer_grid_has_none(monkeypatch):
    calls = []

    def fails_once(model, wrt, **options):
        calls.append(len(wrt))
        if len(calls) == 3:
            raise FesdError(wrt, 'none', 'none')
        return pyomo_fesd.simulate(model, wrt, **options)

    monkeypatch.setattr(solver, 'simulate', fails_once)
    m = dcs(oscillator.build())
    assert not pyomo_fesd.refine(m, 1e-6, max_rounds=3).reached
    # the model gets the grid and the values of that round back, without another simulation
    assert len(calls) == 3 and calls[1] == len(m.t)


def bump():
    """z' = 1 while sin(3 s) >= 0.95, for arcs of 0.635/3 about s = pi/6 and s = 5 pi/6; else z' = 0."""
    m = decay((0, 3), 0.1)
    m.z = pyo.Var(m.t, initialize=0)
    m.dz = dae.DerivativeVar(m.z)
    m.z[0].fix(0)
    s = pyomo_fesd.clock(m, m.t)
    m.arc = Disjunction(
        m.t, rule=lambda m, t: [[pyo.sin(3 * s[t]) >= 0.95, m.dz[t] == 1], [pyo.sin(3 * s[t]) <= 0.95, m.dz[t] == 0]]
    )
    return dcs(m)


@pytest.mark.parametrize('nfe', [2, 3])
def test_switches_that_coarse_grids_overlook_are_found(nfe):
    m = bump()
    found = pyomo_fesd.refine(m, 1e-6, nfe=nfe)
    assert found.reached and found.table['note'].str.contains('overlooked|another order|used up').any()
    assert m.z[3].value == pytest.approx(4 * acos(0.95) / 3, abs=1e-6)
    assert len(pyomo_fesd.switches(m)) == 4


# A round that is undone leaves the model as it was


@pytest.mark.parametrize('build', [lambda: dcs(oscillator.build()), remembered, bouncing_ball.build, problems.controlled_tank])
def test_trial_rounds_leave_the_model_as_it_was(build):
    m = build()
    if m.component('cost') is not None:
        dcs(m)
    before = snapshot(m)
    for number in (8, 10):
        with trial_round(m, m.t):
            finite_elements(m, nfe=number, ncp=2)
            if m.component('cost') is None:
                pyomo_fesd.simulate(m)
            for v in m.component_data_objects(pyo.Var):
                v.set_value(7.0, skip_validation=True)
        assert snapshot(m) == before


def free_control():
    m = held_control.build()
    m.del_component(m.cost)
    m.del_component(m.end)
    return dcs(m), {'piecewise_constant': [m.u]}


def free_variable():
    m = decay()
    m.u = pyo.Var(m.t, initialize=0)
    m.uses = pyo.Constraint(m.t, rule=lambda m, t: m.u[t] <= 1)
    m.ode.deactivate()
    m.law = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    return m, {}


def fixed_at_the_end():
    m = decay()
    m.x[10].fix(0)
    return m, {}


def free_start():
    m = decay()
    m.x[0].unfix()
    return m, {}


def waiting():
    return signum.build(), {}


def infeasible():
    m = dcs(held_control.build())
    m.too_far = pyo.Constraint(expr=m.x[2] >= 1)
    return m, {'piecewise_constant': [m.u], 'max_rounds': 2, 'nfe': 2}


def with_keywords(**keywords):
    return lambda: (dcs(signum.build()), keywords)


@pytest.mark.parametrize(
    'build, message',
    [
        (free_control, 'no objective'),
        (free_variable, 'nothing determines'),
        (fixed_at_the_end, 'fixed after the first time, and there is no objective'),
        (free_start, 'neither fixed at the first time'),
        (waiting, 'an active Disjunction over time'),
        (infeasible, 'no certified solution with nfe'),
        (with_keywords(tolerance=0), 'tolerance: refine: it is 0'),
        (with_keywords(tolerance=-1e-3), 'it is -0.001'),
        (with_keywords(tolerance=nan), 'it is nan'),
        (with_keywords(tolerance=inf), 'it is inf'),
        (with_keywords(max_rounds=1), 'max_rounds: refine: it is 1'),
        (with_keywords(nfe=[3, 3]), 'lists 2 numbers for 1 control stages'),
        (with_keywords(quantities='x'), 'this is a str, not a component'),
    ],
)
def test_refused(build, message):
    m, keywords = build()
    before = snapshot(m)
    with pytest.raises(FesdError, match=message):
        pyomo_fesd.refine(m, **keywords)
    assert snapshot(m) == before


def test_discretised_models_are_refused():
    m = finite_elements(dcs(signum.build()))
    with pytest.raises(FesdError, match='discretised already'):
        pyomo_fesd.refine(m)


def test_an_unknown_option_is_the_solvers_business():
    m = dcs(signum.build())
    before = snapshot(m)
    with pytest.raises(ValueError):
        pyomo_fesd.refine(m, no_such_option=1)
    assert snapshot(m) == before


def test_an_interruption_leaves_the_model_as_it_was(monkeypatch):
    def interrupt(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(solver, 'simulate', interrupt)
    m = dcs(signum.build())
    before = snapshot(m)
    with pytest.raises(KeyboardInterrupt):
        pyomo_fesd.refine(m)
    assert snapshot(m) == before


# Laws


@given(st.floats(0.6, 6), st.floats(1.2, 4), st.floats(1.2, 4))
def test_the_order_of_errors_that_follow_one_is_found_or_less(p, first, second):
    numbers = [10, 10 * first, 10 * first * second]
    errors = [n**-p for n in numbers]
    found = observed_order(numbers, [errors[0] - errors[1], errors[1] - errors[2]], 7)
    assert LEAST_ORDER <= found <= p * (1 + 1e-6)
    if second <= first:
        assert found == pytest.approx(p, rel=1e-6)


STAGES = st.lists(st.tuples(st.integers(2, 50), st.floats(0.1, 10), st.floats(0.1, 10)), min_size=1, max_size=6)


def dense(stages):
    """Numbers of elements, and a piece for each stage."""
    return [n for n, _, _ in stages], [DensePiece(k, length, density) for k, (_, length, density) in enumerate(stages)]


@given(STAGES, st.floats(1.2, 4))
def test_errors_fall_with_the_order_if_all_numbers_grow(stages, factor):
    numbers, pieces = dense(stages)
    M, grown = (sum(expected(np.array(numbers) * f, pieces, 5)) for f in (1, factor))
    assert grown == pytest.approx(M * factor**-5)


@given(STAGES, st.floats(0, 100))
def test_next_numbers(stages, factor):
    numbers, pieces = dense(stages)
    following = next_numbers(numbers, pieces, 5, factor, [10**6] * len(numbers))
    assert all(a <= b for a, b in zip(numbers, following)) and following != numbers
    assert sum(following) <= 1.05 * GROWTH[1] * sum(numbers) + 1
    grown = sum(expected(following, pieces, 5)) <= sum(expected(numbers, pieces, 5)) * min(max(factor, GROWTH[0]), GROWTH[1]) ** -5
    assert grown or sum(following) >= GROWTH[1] * sum(numbers)
    assert next_numbers(numbers, pieces, 5, factor, numbers) == numbers


def test_a_short_piece_needs_no_second_element_before_the_others_are_as_short():
    pieces = [DensePiece(0, 0.01, 1.0), DensePiece(0, 0.99, 1.0)]
    few, more = (expected([n], pieces, 5)[0] for n in (10, 20))
    assert few - more == pytest.approx((1 - 2**-5) * (0.99 / 0.1) * 0.1**6, rel=1e-3)


def test_a_round_with_more_switches_than_elements_is_given_up_before_the_optimisation(monkeypatch):
    """A thermostat with 9 switches in 3 elements: no NLP is spent on it."""
    m = simulations.buck_hysteresis(end=2.0)
    m.cost = pyo.Objective(expr=m.i[m.t.last()])
    dcs(m, hysteresis=[m.switch])
    solved, solve = [], RoundSolver._optimise

    def watched(self, numbers, before):
        started = len(solved)
        monkeypatch.setattr(
            'pyomo_fesd.refinement.round_solver.SolverFactory', lambda name: solved.append(name) or SolverFactory(name)
        )
        error = solve(self, numbers, before)
        assert (error is None) == (len(solved) > started)
        return error

    monkeypatch.setattr(RoundSolver, '_optimise', watched)
    found = pyomo_fesd.refine(m, tolerance=1e-3, nfe=2)
    assert found.reached and 'used up' in found.table['note'].iloc[0]
