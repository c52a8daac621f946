"""Hysteresis between elements: the law of switching, and whole paths with exact answers."""

import itertools

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import thermostat
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.gdp import Disjunct, Disjunction

import pyomo_fesd
from pyomo_fesd import FesdError, certify
from pyomo_fesd.core import moving_grids
from pyomo_fesd.core.complementarity import read_complementarity
from pyomo_fesd.finite_elements.hysteresis import LEFT, read_hysteresis
from tests.models import collocate, dcs, finite_elements, scalar_ode, snapshot
from tests.problems import best_threshold, burst_disc, gears, refilled, setpoints, thermostats, two_tanks
from tests.problems.running import LEGENDRE, RADAU, SCHEMES, lengths, move, seen

HEATING = 'relay 1'


def moved(m, hysteresis, nfe, ncp, **keywords):
    """Both transformations."""
    return move(dcs(m, hysteresis=hysteresis), nfe, ncp, **keywords)


def marched(m):
    """Simulated, then solved from there and certified."""
    pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B' and results.solver.nlps <= 12
    return m


def found(m, *names):
    """``(time, before, after)`` of the switches of these Disjunctions."""
    return [(s.time, s.before, s.after) for s in pyomo_fesd.switches(m) if s.disjunction in names]


def near(switches, tolerance=1e-7):
    """Switches that agree with these."""
    return [(pytest.approx(time, abs=tolerance), before, after) for time, before, after in switches]


def heater(horizon):
    """The switches of the thermostat."""
    names = itertools.cycle([('heating', 'cooling'), ('cooling', 'heating')])
    return [(time, *pair) for time, pair in zip(thermostat.switching_times(horizon), names)]


def on_grid(m):
    """The block of the law."""
    return m._pyomo_fesd_elements_t.hysteresis


# The law


@pytest.mark.parametrize('before, after, c', list(itertools.product([0, 1], [0, 1], [-1.0, 0.0, 1.0])))
def test_a_mode_is_on_only_in_its_region_and_left_only_at_its_end(before, after, c):
    m = thermostat.transform(thermostat.build(2), 4, 2)
    law, (mode, _) = on_grid(m), read_hysteresis(m, m.t)
    elements = moving_grids(m)[m.t].grid.elements
    mode.weight(elements[0]).expr.set_value(before)
    mode.weight(elements[1]).expr.set_value(after)
    m.y[elements[0].right].value = 20 - c
    law.n[HEATING, 1, 1, LEFT].value = max(-c, 0)
    pairs = (law.parts[HEATING, 1, 1, LEFT], law.region[HEATING, 1, 1, LEFT], law.leaving[HEATING, 1])
    on = before or after
    assert all(map(holds, pairs)) == ((c >= 0 or not on) and (c == 0 or not before or after))


def holds(pair):
    """Whether one side of a pair is zero and the other not negative."""
    return min(map(pyo.value, read_complementarity(pair))) == 0


@pytest.mark.parametrize('low, high', list(itertools.product([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0])))
def test_a_mode_with_two_conditions_is_left_where_the_least_of_them_ends(low, high):
    m = gears.build()
    moved(m, [m.gear], 4, 1)
    law, mode, elements = on_grid(m), 'gear 2', moving_grids(m)[m.t].grid.elements
    (second,) = [found for found in read_hysteresis(m, m.t) if found.name == mode]
    for k, c in enumerate((low, high), start=1):
        law.positive[mode, 2, k, LEFT].set_value(max(c, 0))
    m_2 = law.m[mode, 2, 2]
    nu, after = (second.weight(e).expr for e in elements[1:3])
    # the least of both is the only value that m can take
    for m_2.value in (-1, 0, 0.5, 1, 2):
        least = min(max(low, 0), max(high, 0))
        assert (holds(law.least[mode, 2, 2]) and m_2.value >= m_2.lb) == (m_2.value == least)
    m_2.value = least
    for nu.value, after.value in itertools.product((0, 1), (0, 1)):
        assert holds(law.leaving[mode, 2]) == (least == 0 or not nu.value or after.value == 1)


def test_one_weight_an_element_and_a_few_variables_a_boundary():
    m = thermostat.transform(thermostat.build(2), 5, 3)
    weights = {id(mode.weights[t].expr) for mode in read_hysteresis(m, m.t)[:1] for t in m.t}
    assert len(weights) == 5
    law = on_grid(m)
    # both modes have one condition: n at all boundaries, and a pair for leaving inside
    assert (len(law.n), len(law.m), len(law.stays), len(law.binary)) == (2 * 6, 0, 0, 5)
    assert [len(pair) for pair in (law.parts, law.region, law.least, law.leaving)] == [2 * 6, 2 * 6, 0, 2 * 4]
    report = pyomo_fesd.report(m)
    assert report['variables'] == 5 + 5 * 3 * 2 + 1 + 12 + 4  # r, y and dy, dy at the start, n, nu (one is given)


def test_a_mode_that_is_given_at_the_first_time_is_that_of_the_first_element():
    m = thermostat.transform(thermostat.build(2), 4, 2)
    (mode, _), grid = read_hysteresis(m, m.t), moving_grids(m)[m.t].grid
    assert mode.weight(grid.elements[0]).expr.fixed and mode.weights[0].expr is mode.weight(grid.elements[0]).expr
    assert not mode.weight(grid.elements[1]).expr.fixed


def test_more_than_two_modes_exclude_one_another():
    m = gears.build()
    moved(m, [m.gear], 4, 1)
    law = on_grid(m)
    assert len(law.one) == 4 and len(law.binary) == 8


def test_modes_are_called_as_the_user_calls_them():
    def titles(m, *names):
        dcs(m, hysteresis=list(names))
        return [(mode.system, mode.title) for mode in read_hysteresis(m, m.t)]

    m = gears.build()
    assert titles(m, m.gear) == [('gear', f'gear: {name}') for name in ('first', 'second', 'third')]
    m = thermostats.build(time_first=True)
    assert ('relay[b]', 'relay[b]: cooling[b]') in titles(m, m.relay)
    m = thermostats.build_in_blocks()
    assert titles(m, m) == [('hyb.relay', 'hyb.relay: heating'), ('hyb.relay', 'hyb.relay: cooling')]
    m = two_tanks.build()
    assert titles(m, m.hose) == [('hose', 'hose: fill[1]'), ('hose', 'hose: fill[2]')]
    m = scalar_ode()
    m.d = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.dx[t] == 1], [m.x[t] >= 0, m.dx[t] == -1]])
    assert titles(m, m.d) == [('d', 'd: mode 1'), ('d', 'd: mode 2')]


# Certificates: nothing but the modes ties a boundary to the end of a condition


def locally_best(case, high, reach=1e-3):
    """Whether no threshold nearby with the same number of phases costs clearly less, by the exact costs."""
    number, J = len(case.phases(high)), case.cost(high)
    nearby = [h for h in (high - reach, high + reach) if len(case.phases(h)) == number]
    return all(case.cost(h) >= J - 1e-5 * J for h in nearby)


@pytest.mark.parametrize('nfe, guess', [(8, 19), (10, 19), (10, 20), (11, 20), (12, 21.5)])
def test_a_threshold_is_optimised_on_every_grid(nfe, guess):
    case = best_threshold.Case()
    m = best_threshold.build(case, guess, nfe)
    for warm_start in (False, True):
        results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=warm_start)
        assert results.solver.stationarity == 'B'
        assert m.high.value == pytest.approx(20.93484, abs=1e-4)
        assert pyo.value(m.cost) == pytest.approx(case.cost(m.high.value), rel=1e-6)


@given(
    case=st.builds(
        best_threshold.Case,
        horizon=st.floats(0.6, 1.6),
        low=st.floats(16, 17.5),
        wish=st.floats(17.5, 20.5),
        weight=st.floats(1, 20),
        price=st.floats(0, 40),
    ),
    guess=st.floats(18.5, 22),
    nfe=st.integers(8, 14),
)
@settings(max_examples=15, deadline=None, derandomize=True)
def test_a_certified_threshold_is_locally_best(case, guess, nfe):
    m = best_threshold.build(case, guess, nfe)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B' and pyo.value(m.cost) == pytest.approx(case.cost(m.high.value), rel=1e-5)
    assert locally_best(case, m.high.value)
    # all generated variables are functions of the states: computed anew, they change nothing
    law = on_grid(m)
    for mode in moving_grids(m)[m.t].hysteresis.modes:
        for b, label in enumerate([0, *(e.right for e in moving_grids(m)[m.t].grid.elements)]):
            law.n[mode.name, b, 1, LEFT].value = max(-pyo.value(mode.condition(1)[label]), 0.0)
    assert certify(m).certified


# Whole paths


@pytest.mark.parametrize('scheme', SCHEMES)
def test_thermostat(scheme):
    m = marched(thermostat.transform(thermostat.build(2), 10, 3, scheme))
    assert found(m, 'relay') == near(heater(2))


def test_the_homotopy_finds_one_switch_by_itself():
    m = thermostat.transform(thermostat.build(1), 6, 3)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    assert found(m, 'relay') == near(heater(1))


def test_lengths_are_equal_between_switches():
    m = marched(thermostat.transform(thermostat.build(1), 6, 3))
    (first, *_) = [t for t, _, _ in heater(1)]
    ends = list(itertools.accumulate(lengths(m)))
    number = 1 + min(range(6), key=lambda k: abs(ends[k] - first))
    expected = [first / number] * number + [(1 - first) / (6 - number)] * (6 - number)
    assert lengths(m) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize(
    'order, scheme', [(('first', 'second', 'third'), LEGENDRE), (('third', 'first', 'second'), RADAU)], ids=['in order', 'mixed']
)
def test_three_gears_up_and_down(order, scheme):
    m = gears.build(order)
    marched(moved(m, [m.gear], 14, 1, scheme=scheme))
    assert found(m, 'gear') == near(gears.SWITCHES)
    assert m.v[gears.END].value == pytest.approx(gears.FINAL, abs=1e-7)


def test_two_gears_where_the_third_is_switched_off():
    # at v = 5 no other gear is left
    m = gears.build()
    m.third.deactivate()
    with pytest.raises(FesdError, match='0 modes can follow where this one ends'):
        pyomo_fesd.simulate(moved(m, [m.gear], 14, 1))


def test_a_disc_that_bursts_stays_open():
    m = burst_disc.build()
    marched(moved(m, [m.disc], 8, 4))
    assert found(m, 'disc') == near([(burst_disc.SWITCH, 'closed', 'burst')])
    assert m.p[burst_disc.END].value == pytest.approx(burst_disc.FINAL, abs=1e-7)


@pytest.mark.parametrize('time_first', [False, True])
def test_several_at_once_switch_at_their_own_times(time_first):
    m = thermostats.build(time_first=time_first)
    marched(moved(m, [m.relay], 15, 3))
    for i in m.i:
        times = [s.time for s in pyomo_fesd.switches(m) if s.disjunction == f'relay[{i}]']
        assert times == pytest.approx(thermostats.switching_times(i, 1.5), abs=1e-7)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_modes_in_blocks_over_time(scheme):
    m = thermostats.build_in_blocks()
    marched(moved(m, [m], 8, 3, scheme=scheme))
    assert found(m, 'hyb.relay') == near(heater(1.5))


@pytest.mark.parametrize('how, scheme', [('control', RADAU), ('control', LEGENDRE), ('algebraic', LEGENDRE), ('numbers', RADAU)])
def test_set_points_that_differ_from_stage_to_stage(how, scheme):
    m = setpoints.build(how)
    moved(m, [m.relay], 12, 1, scheme=scheme, piecewise_constant=setpoints.controls(m))
    for u in setpoints.controls(m):
        for t, w in u.items():
            w.fix(setpoints.setpoint(t))
    marched(m)
    assert found(m, 'relay') == near(setpoints.SWITCHES)
    assert m.x[12].value == pytest.approx(setpoints.FINAL, abs=1e-7)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_jump_of_the_state_may_end_a_mode(scheme):
    m = refilled.build()
    marched(moved(m, [m.relay], 12, 1, scheme=scheme))
    assert found(m, 'relay') == near(refilled.SWITCHES)
    assert [s.time for s in pyomo_fesd.switches(m) if s.disjunction == 'refill'] == pytest.approx(refilled.REFILLS, abs=1e-7)
    assert m.x[refilled.END].value == pytest.approx(refilled.FINAL, abs=1e-7)


def test_the_right_condition_stands_there_only_where_it_may_differ():
    m = refilled.build()
    moved(m, [m.relay], 4, 1)
    assert len(on_grid(m).beyond) == 2 * 3
    m = setpoints.build()
    moved(m, [m.relay], 6, 1, piecewise_constant=[m.w])
    assert {b for _, b, _ in on_grid(m).beyond} == {2, 4}
    assert not on_grid(thermostat.transform(thermostat.build(2), 4, 1)).beyond


# After the solve


def test_indicators_tell_the_mode():
    m = marched(thermostat.transform(thermostat.build(2), 10, 3))
    assert m.heating[0].indicator_var.value is True and m.cooling[0].indicator_var.value is False
    assert m.heating[1].indicator_var.value is False and m.cooling[1].indicator_var.value is True


def test_the_multipliers_are_in_the_trajectory():
    m = marched(thermostat.transform(thermostat.build(1), 6, 2))
    frame = pyomo_fesd.trajectory(m)
    assert set(frame['relay: heating'].round(9)) == {0, 1}
    assert (frame['relay: heating'] + frame['relay: cooling']).tolist() == pytest.approx([1] * len(frame))


# Orders, clones, refusals


@pytest.mark.parametrize('scheme', [RADAU, LEGENDRE])
def test_transformed_after_discretisation(scheme):
    m = thermostat.room(2)
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=10, ncp=3, scheme=scheme)
    thermostat.add_heater(m)
    marched(moved(m, [m.relay], 10, 3))
    assert found(m, 'relay') == near(heater(2))


def test_a_clone_of_a_moved_model_is_independent():
    m = thermostat.transform(thermostat.build(1), 6, 3)
    before = seen(m)
    copy = m.clone()
    marched(copy)
    assert found(copy, 'relay') == near(heater(1))
    assert seen(m) == before


def test_create_using():
    m = thermostat.build(1)
    dcs(m, hysteresis=[m.relay])
    before = snapshot(m)
    copy = pyo.TransformationFactory('fesd.finite_elements').create_using(m, nfe=6, ncp=3)
    assert snapshot(m) == before
    assert found(marched(copy), 'relay') == near(heater(1))


def test_two_times_with_hysteresis_do_not_disturb_each_other():
    m = pyo.ConcreteModel()
    m.a, m.b = pyo.Block(), pyo.Block()
    for block, end in ((m.a, 1), (m.b, 2)):
        block.t = dae.ContinuousSet(bounds=(0, end))
        block.y = pyo.Var(block.t, initialize=15)
        block.dy = dae.DerivativeVar(block.y)
        block.y[0].fix(15)

        def modes(block):
            def heating(d, t):
                d.until = pyo.Constraint(expr=block.y[t] <= 20)
                d.ode = pyo.Constraint(expr=block.dy[t] == 10 - block.y[t] / 5)

            def cooling(d, t):
                d.until = pyo.Constraint(expr=block.y[t] >= 18)
                d.ode = pyo.Constraint(expr=block.dy[t] == -block.y[t] / 5)

            block.heating, block.cooling = Disjunct(block.t, rule=heating), Disjunct(block.t, rule=cooling)
            block.relay = Disjunction(block.t, rule=lambda b, t: [block.heating[t], block.cooling[t]])
            block.heating[0].indicator_var.fix(True)

        modes(block)
    for block in (m.a, m.b):
        pyo.TransformationFactory('fesd.dcs').apply_to(m, wrt=block.t, hysteresis=[block.relay], targets=[block])
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.a.t, nfe=6, ncp=3)
    assert [mode.name for mode in read_hysteresis(m, m.a.t)] == ['a.relay 1', 'a.relay 2']
    assert m.a.t in moving_grids(m) and m.b.t not in moving_grids(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.b.t, nfe=10, ncp=3)
    for block in (m.a, m.b):
        pyomo_fesd.simulate(m, block.t)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B'
    for block, end in ((m.a, 1), (m.b, 2)):
        times = [s.time for s in pyomo_fesd.switches(m, block.t)]
        assert times == pytest.approx(thermostat.switching_times(end), abs=1e-7)


def test_an_error_leaves_the_model():
    m = thermostat.build(1)
    dcs(m, hysteresis=[m.relay])
    m.far = pyo.Objective(m.t, rule=lambda m, t: m.y[t])
    before = snapshot(m)
    with pytest.raises(FesdError, match='Objective over time cannot be discretised'):
        finite_elements(m, 6, 3)
    assert snapshot(m) == before
    m.del_component(m.far)
    finite_elements(m, 6, 3)
    assert found(marched(m), 'relay') == near(heater(1))


def test_an_ordinary_grid_is_refused():
    m = thermostat.add_heater(collocate(thermostat.room()))
    dcs(m, hysteresis=[m.relay])
    with pytest.raises(FesdError, match='apply fesd.finite_elements first'):
        pyo.SolverFactory('mpec_hybrid').solve(m)
