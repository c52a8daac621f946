"""A final time, or lengths of control stages, that are variables; the plant is written in its own time."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import dcs
from tests.problems import double_integrator, free_start, rest_to_rest, turbo_car, weir
from tests.problems.running import LEGENDRE, RADAU, SCHEMES, lengths, move, run, seen, solve, transform


def certified(m):
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B', results.solver.reason
    return m


# Shortest times


@pytest.mark.parametrize('points', [(0, 3), (0, 0.6), (2, 5)], ids=str)
@pytest.mark.parametrize('scheme, ncp', [(RADAU, 2), (LEGENDRE, 2), (LEGENDRE, 1)])
def test_a_mass_is_moved_in_the_shortest_time_whatever_the_labels(scheme, ncp, points):
    m = rest_to_rest.build(points)
    certified(move(m, 6, ncp, scheme=scheme, final_time=m.T))
    assert m.T.value == pytest.approx(rest_to_rest.SHORTEST, abs=1e-7)
    times = list(pyomo_fesd.physical_time(m).values())
    assert (times[0], times[-1]) == pytest.approx((points[0], points[0] + rest_to_rest.SHORTEST), abs=1e-7)


def test_equations_that_are_scaled_by_hand_still_work():
    m = rest_to_rest.build(scaled=True)
    certified(move(m, 6, 2))
    assert m.T.value == pytest.approx(rest_to_rest.SHORTEST, abs=1e-7)
    assert list(pyomo_fesd.physical_time(m).values())[-1] == 1


@pytest.mark.parametrize('scheme', SCHEMES)
def test_bang_bang_with_two_stages_of_free_length_needs_one_element_each(scheme):
    m = rest_to_rest.build((0, 1, 2))
    m.cost.deactivate()
    m.length = pyo.Var([1, 2], bounds=(0.1, None), initialize=1)
    m.total = pyo.Objective(expr=m.length[1] + m.length[2])
    certified(move(m, 2, 2, scheme=scheme, stage_lengths=m.length, piecewise_constant=[m.u]))
    expected = [2 / 3 * rest_to_rest.SHORTEST, rest_to_rest.SHORTEST / 3]
    assert [v.value for v in m.length.values()] == pytest.approx(expected, abs=1e-7)
    assert (m.u[1].value, m.u[2].value) == pytest.approx((1, -2), abs=1e-7)
    assert lengths(m) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_car_with_a_turbo_takes_its_shortest_time(scheme):
    m = turbo_car.build((0, 1, 2))
    m.T = pyo.Var(bounds=(1, 30), initialize=7)
    m.cost = pyo.Objective(expr=m.T)
    certified(transform(m, 8, 2, scheme=scheme, final_time=m.T, piecewise_constant=[m.u]))
    assert m.T.value == pytest.approx(turbo_car.SHORTEST, abs=1e-7)
    found = pyomo_fesd.switches(m)
    assert [s.time for s in found] == pytest.approx([2, 4], abs=1e-7)
    assert pyomo_fesd.physical_time(m)[1] == pytest.approx(3, abs=1e-7)  # stage boundaries scale with the final time


def test_a_car_that_cruises_has_three_stages_of_free_length():
    m = turbo_car.build((0, 1, 2, 3), distance=150)
    m.length = pyo.Var(range(3), bounds=(0.1, None), initialize=3)
    m.total = pyo.Objective(expr=sum(m.length.values()))
    certified(transform(m, [3, 1, 3], 2, stage_lengths=list(m.length.values()), piecewise_constant=[m.u]))
    assert [v.value for v in m.length.values()] == pytest.approx([3, 3.8, 3], abs=1e-6)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([2, 7.8], abs=1e-6)


# Everything is measured in time of the plant


def test_a_free_time_that_is_fixed_changes_nothing_but_the_labels():
    reference = run(free_start.build(-2), 6, 2)
    m = free_start.build(-2, bounds=(0, 1))
    m.T = pyo.Var()
    m.T.fix(2)
    m.first = dae.Integral(m.t, rule=lambda m, t: m.x[t])
    run(m, 6, 2, final_time=m.T)
    assert m.x[1].value == pytest.approx(reference.x[2].value, abs=1e-9)
    assert pyo.value(m.first) == pytest.approx(2 / 9, abs=1e-9)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(2 / 3, abs=1e-9)
    assert sum(lengths(m)) == pytest.approx(2, abs=1e-9)
    assert pyomo_fesd.trajectory(m).index[-1] == pytest.approx(2, abs=1e-9)
    assert pyomo_fesd.plot(m, names=['x']).axes[0].lines[0].get_xdata()[-1] == pytest.approx(2, abs=1e-9)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_the_time_at_which_a_state_reaches_its_goal_is_found(scheme):
    m = free_start.build(-2, bounds=(0, 1))
    m.T = pyo.Var(bounds=(0.5, 20), initialize=1)
    m.goal = pyo.Constraint(expr=m.x[1] == 4)
    run(m, 8, 2, scheme=scheme, final_time=m.T)
    assert m.T.value == pytest.approx(2 / 3 + 4, abs=1e-8)


def test_second_derivatives_get_the_square():
    m = double_integrator.build()
    m.T = pyo.Var()
    m.T.fix(2)
    other = scaled_to_one(m.T)
    run(other, 5, 3, final_time=other.T)
    frame = pyomo_fesd.trajectory(other)
    inside = frame[frame['label'].isin(list(other.ddq_disc_eq))]
    expected = np.where(inside.index <= 1 + 1e-9, *double_integrator.ACCELERATIONS)
    assert np.abs(inside['ddq'] - expected).max() <= 1e-7


def scaled_to_one(T):
    """``double_integrator`` over labels from 0 to 1/2."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 0.5))
    m.T = pyo.Var()
    m.T.fix(pyo.value(T))
    m.q, m.v = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=0)
    m.dq, m.dv, m.ddq = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v), dae.DerivativeVar(m.q, wrt=(m.t, m.t))
    m.q[0].fix(1)
    m.v[0].fix(0)
    m.speed = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.ground = Disjunction(m.t, rule=lambda m, t: [[m.q[t] >= 0.5, m.dv[t] == -1], [m.q[t] <= 0.5, m.dv[t] == -0.25]])
    return m


def test_a_clock_shows_the_time_of_the_plant():
    m = rest_to_rest.build()
    c = pyomo_fesd.clock(m)
    move(m, 6, 2, final_time=m.T)
    certified(m)
    for t, now in pyomo_fesd.physical_time(m).items():
        assert c[t].value == pytest.approx(now, abs=1e-8)


def test_a_grid_that_was_there_can_be_stretched_too():
    m = rest_to_rest.build()
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=6, ncp=2)
    certified(move(m, final_time=m.T))
    assert m.T.value == pytest.approx(rest_to_rest.SHORTEST, abs=1e-7)


def test_create_using_takes_the_final_time_of_the_copy():
    m = rest_to_rest.build()
    before = seen(m)
    copy = pyo.TransformationFactory('fesd.finite_elements').create_using(m, nfe=6, ncp=2, final_time=m.T)
    assert seen(m) == before
    assert certified(copy).T.value == pytest.approx(rest_to_rest.SHORTEST, abs=1e-7)
    assert m.T.value == 1


def test_a_hand_written_complementarity_is_measured_in_it_too():
    m = weir.build()
    m.T = pyo.Var(bounds=(0.1, 10), initialize=2)
    m.spilled = dae.Integral(m.t, rule=lambda m, t: m.F[t])
    m.enough = pyo.Constraint(expr=m.spilled == 3)
    solve(move(m, 6, 2, final_time=m.T))
    assert m.T.value == pytest.approx(weir.V_MAX + 3, abs=1e-8)
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(weir.SWITCH, abs=1e-8)


def test_it_costs_one_variable_and_no_equation():
    m, fixed = rest_to_rest.build(), rest_to_rest.build()
    small, large = pyomo_fesd.report(move(fixed, 6, 2)), pyomo_fesd.report(move(m, 6, 2, final_time=m.T))
    assert small == large  # T is in the objective of both


# Start values


@pytest.mark.parametrize('bounds, start', [((0.1, None), 2), ((0.1, 1.5), 1.5), ((3, 9), 3)])
def test_a_time_without_a_value_starts_at_the_labels_as_far_as_its_bounds_allow(bounds, start):
    m = free_start.build(-2)
    m.T = pyo.Var(bounds=bounds)
    transform(m, 4, 2, final_time=m.T)
    assert m.T.value == start


# Refusals


def refused(m, message, **keywords):
    before = seen(m)
    with pytest.raises(FesdError, match=message):
        move(m, 4, 2, **keywords)
    assert seen(m) == before


def with_times():
    m = dcs(free_start.build(-2))
    m.T = pyo.Var(initialize=1)
    m.S = pyo.Var([1, 2], bounds=(1, 2), initialize=1)
    m.P = pyo.Param(initialize=2, mutable=True)
    return m


#: A variable does not keep its model.
OTHER = with_times()


@pytest.mark.parametrize(
    'wrong, message',
    [
        (lambda m: m.T, 'T: final_time: its lower bound is None'),
        (lambda m: m.S, 'S: final_time: not a single variable'),
        (lambda m: m.P, 'P: final_time: not a single variable'),
        (lambda m: 'T', 'T: final_time: not a single variable'),
        (lambda m: 3.0, 'final_time: not a single variable'),
        (lambda m: m.x[2], r'x\[2\]: final_time: it is a variable at one time'),
        (lambda m: OTHER.S[1], r'S\[1\]: final_time: it belongs to another model'),
    ],
    ids=['no bound', 'several', 'Param', 'name', 'number', 'over time', 'other model'],
)
def test_what_is_no_final_time_is_refused(wrong, message):
    m = with_times()
    refused(m, message, final_time=wrong(m))


@pytest.mark.parametrize('domain', [pyo.NonNegativeReals, pyo.Reals])
def test_a_time_that_may_be_zero_is_refused(domain):
    m = with_times()
    m.T.domain = domain
    refused(m, 'T: final_time: its lower bound is', final_time=m.T)
    m.T.setlb(0.5)
    assert len(move(m, 4, 2, final_time=m.T).t) == 9


@pytest.mark.parametrize('value', [0, -1, None])
def test_a_time_that_is_fixed_must_be_positive(value):
    m = with_times()
    m.T.fix(value)
    refused(m, 'T: final_time: it is fixed to', final_time=m.T)


def test_one_length_for_each_stage():
    m = with_times()
    refused(m, r'S\[1\]: stage_lengths: 2 for 1 control stages', stage_lengths=m.S)
    refused(m, 'both final_time and stage_lengths are given', stage_lengths=m.S, final_time=m.S[1])
    refused(m, 'stage_lengths: not a single variable', stage_lengths=['S'])


def test_time_in_a_rule_is_warned_of_and_the_clock_is_named(caplog):
    m = rest_to_rest.build()
    m.ramp = pyo.Constraint(m.t, rule=lambda m, t: m.u[t] <= 1 - t / 9)
    move(m, 4, 2, final_time=m.T)
    (record,) = [r for r in caplog.records if r.name == 'pyomo_fesd']
    assert record.message.startswith('ramp') and 'pyomo_fesd.clock(m, m.t)[t]' in record.message


def test_a_pair_between_plant_and_time_is_possible():
    # stop as soon as the tank is full: 0 <= V_max - V(end) perp T_max - T >= 0
    m = weir.build()
    m.T = pyo.Var(bounds=(0.1, 5), initialize=1)
    m.F.fix(0)
    m.overflow.deactivate()
    m.stop = Complementarity(expr=complements(weir.V_MAX - m.V[2] >= 0, 5 - m.T >= 0))
    m.cost = pyo.Objective(expr=-m.T)
    certified(move(m, 4, 2, final_time=m.T, piecewise_constant=[m.F]))
    assert m.T.value == pytest.approx(weir.V_MAX, abs=1e-7)
