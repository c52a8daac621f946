"""``simulate``: systems with exact answers, the state of the model afterwards, and every error."""

from math import exp, log

import bouncing_ball
import gas_liquid_tank
import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
import thermostat
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.common.timing import HierarchicalTimer
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.simulation.element_class import ElementClass
from tests.models import add_modes, dcs, scalar_ode, signum_of_scalars, units, units_by_index
from tests.problems import (
    air_friction,
    clock,
    crossing,
    held_control,
    quadratic_drag,
    relay_of_states,
    setpoints,
    sliding,
    threshold,
    two_systems,
    two_tanks,
    weir,
)
from tests.problems.running import LEGENDRE, RADAU, SCHEMES, move, seen, solve, transform
from tests.problems.states import over_time

TANK = gas_liquid_tank.EXACT


def simulated(m, **keywords):
    """Simulated; returns the model."""
    pyomo_fesd.simulate(m, **keywords)
    return m


def times(m, name=None):
    """Times of the switches."""
    return [s.time for s in pyomo_fesd.switches(m) if name in (None, s.disjunction)]


def bare(m):
    """Everything that a user sees of a model but the values of its variables."""
    found = {k: v for k, v in seen(m).items() if not (isinstance(v, tuple) and len(v) == 2)}
    for v in m.component_data_objects(pyo.Var):
        found[v.name] = (v.fixed, v.lower, v.upper, v.domain.name)
    return found


# Filippov systems


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize(
    'build, switches, final',
    [
        (signum.build, [signum.SWITCH], ('x', signum.FINAL)),
        (crossing.build, [crossing.SWITCH], ('x', crossing.FINAL)),
        (sliding.build, [sliding.SWITCH], ('x', 0.0)),
        (clock.build, [clock.SWITCH], ('x', clock.FINAL)),
        (two_systems.build, [t for t, _ in two_systems.SWITCHES], ('x', two_systems.FINAL_X)),
        (relay_of_states.build, [relay_of_states.SWITCH], ('x', relay_of_states.FINAL)),
    ],
    ids=lambda v: v.__module__.split('.')[-1] if callable(v) else '',
)
def test_switches_and_end_are_exact(build, switches, final, scheme):
    m = simulated(transform(build(), 8, 3, scheme=scheme))
    assert times(m) == pytest.approx(switches, abs=1e-7)
    assert m.component(final[0])[m.t.last()].value == pytest.approx(final[1], abs=1e-7)


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
def test_tank(form):
    m = simulated(transform(gas_liquid_tank.build(), 20, 4, form=form))
    found = gas_liquid_tank.found(m)
    assert found['t_s'] == pytest.approx(TANK['t_s'], abs=1e-7)
    assert found['M_G'] == pytest.approx(TANK['M_G'], rel=1e-7)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.after == 'sliding liquid | gas'


@pytest.mark.parametrize('build', ['build_in_blocks', 'build_eliminated'])
def test_tank_however_it_is_written(build):
    m = simulated(transform(getattr(gas_liquid_tank, build)(), 12, 4))
    assert gas_liquid_tank.found(m)['t_s'] == pytest.approx(TANK['t_s'], abs=1e-7)


def test_oscillator():
    m = simulated(transform(oscillator.build(), 40, 3, scheme=LEGENDRE))
    assert times(m) == pytest.approx([oscillator.SWITCH], abs=1e-6)
    assert oscillator.error(m) <= 2e-5


def test_a_slide_on_a_curved_surface():
    m = simulated(transform(sliding.build_curved(), 8, 3))
    assert times(m) == pytest.approx([sliding.CURVED['switch']], abs=1e-7)
    assert m.x[0.45].value == pytest.approx(sliding.CURVED['x'], abs=1e-7)
    assert pyomo_fesd.trajectory(m)['bowl: mode 1'].iloc[-1] == pytest.approx(sliding.CURVED['nu'], abs=1e-6)


@pytest.mark.parametrize('build', [signum_of_scalars, units, units_by_index])
def test_modes_in_blocks_and_indices(build):
    m = build()
    for v in m.component_data_objects(pyo.Var):
        if v.index() == 0 or (isinstance(v.index(), tuple) and 0 in v.index()):
            v.fix(v.value) if v.value is not None and v.parent_component().local_name in 'xy' else None
    if m.component('y') is not None:
        m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    simulated(transform(m, 10, 2))
    exact = [2 / 3, 1.0] if build is not signum_of_scalars else [2 / 3]
    assert sorted(times(m)) == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize('level', ['state', 'algebraic', 'coupled'])
@pytest.mark.parametrize('slack_first', [True, False])
def test_a_hand_written_condition(level, slack_first):
    m = simulated(move(weir.build(level, slack_first), 6, 2))
    assert times(m) == pytest.approx([weir.SWITCH], abs=1e-7)
    assert m.F[2].value == pytest.approx(weir.OVERFLOW, abs=1e-7)


def test_conditions_over_time_and_more():
    m = simulated(move(weir.build_series(), 8, 2))
    assert sorted(times(m)) == pytest.approx(weir.SWITCHES, abs=1e-7)


def test_a_nonsmooth_term():
    m = quadratic_drag.build(10, 4)
    m.impact.deactivate()
    # thrown up at 2 m/s
    m.v[0].fix(2.0)
    m.q[0].fix(5.0)
    simulated(move(m, 10, 4))
    up, height = quadratic_drag.rise(2.0)
    assert times(m) == pytest.approx([up], abs=1e-7)
    assert max(pyomo_fesd.trajectory(m)['q']) == pytest.approx(5 + height, abs=1e-6)


def test_the_same_as_all_elements_at_once():
    m = transform(gas_liquid_tank.build(), 20, 3)
    pyomo_fesd.simulate(m)
    marched = gas_liquid_tank.found(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B' and results.solver.nlps <= 3
    # the lengths differ, and so do errors of the discretisation
    assert gas_liquid_tank.found(m)['t_s'] == pytest.approx(marched['t_s'], abs=1e-7)
    assert gas_liquid_tank.found(m)['M_G'] == pytest.approx(marched['M_G'], rel=1e-6)


@pytest.mark.parametrize('order', ['before', 'after'])
def test_both_orders_of_the_transformations(order):
    m = scalar_ode(end=2)
    if order == 'after':
        pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=6, ncp=2, scheme=RADAU)
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.dx[t] == 3], lambda m, t: [m.x[t] >= 0, m.dx[t] == 1])
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(1)
    simulated(transform(m, 6, 2))
    assert times(m) == pytest.approx([2 / 3], abs=1e-7)


@pytest.mark.parametrize('cross', ['element', 'point', 'full'])
def test_every_form_of_cross_complementarity(cross):
    m = simulated(transform(two_systems.build(), 8, 2, cross_complementarity=cross))
    assert sorted(times(m)) == pytest.approx([t for t, _ in two_systems.SWITCHES], abs=1e-7)


def test_backward_differences():
    m = over_time(1.5, x=-1)
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.t, nfe=6, scheme='BACKWARD')
    m.zero = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 2], [m.x[t] >= 0, m.dx[t] == 0.2]])
    simulated(transform(m, 6))
    assert times(m) == pytest.approx([crossing.SWITCH], abs=1e-7)
    assert m.x[1.5].value == pytest.approx(crossing.FINAL, abs=1e-7)


# Grids


def test_a_single_element():
    m = crossing.build()
    m.x[0].fix(1.0)
    simulated(transform(m, 1, 2))
    assert m.x[1.5].value == pytest.approx(1.3, abs=1e-9)
    m = simulated(move(bouncing_ball.build(1.0, 0.4), 1, 2))
    assert m.q[0.4].value == pytest.approx(0.8 - 9.81 * 0.08, abs=1e-7)


def test_an_element_for_each_switch_and_one_more_suffice():
    m = simulated(move(bouncing_ball.build(), 5, 2))
    assert times(m) == pytest.approx(bouncing_ball.impacts(), abs=1e-7)
    with pytest.raises(FesdError, match=r'the elements of control stage 1 are used up at time 2.82699, after 4 switches'):
        simulated(move(bouncing_ball.build(), 4, 2))


def test_without_a_switch_all_elements_are_equal():
    m = crossing.build()
    m.x[0].fix(1.0)
    simulated(transform(m, 5, 2))
    assert pyomo_fesd.element_lengths(m)['length'].tolist() == pytest.approx([0.3] * 5)


def test_lengths_fill_the_stages():
    m = thermostat.build(2)
    m.t.add(1)
    simulated(move(dcs(m, hysteresis=[m.relay]), 10, 3))
    ends = pyomo_fesd.element_lengths(m)['end']
    assert (ends.iloc[4], ends.iloc[-1]) == (pytest.approx(1, abs=1e-12), pytest.approx(2, abs=1e-12))
    assert times(m) == pytest.approx(thermostat.switching_times(2), abs=1e-7)


def test_the_last_stage_has_too_few_elements():
    m = bouncing_ball.build(1.0, 4)
    m.t.add(0.3)
    with pytest.raises(FesdError, match='the elements of control stage 2 are used up'):
        simulated(move(m, 8, 2))


# Controls


def test_controls_that_are_held_need_not_be_named():
    m = held_control.build()
    transform(m, 8, 2, piecewise_constant=[m.u])
    for t in m.t:
        m.u[t].value = held_control.CONTROLS[0] if t <= 1 else held_control.CONTROLS[1]
    simulated(m)
    assert times(m) == pytest.approx([held_control.SWITCH], abs=1e-7)
    assert m.x[2].value == pytest.approx(0.3, abs=1e-7)


def test_the_value_at_the_end_of_its_stage_counts():
    m = held_control.build()
    transform(m, 8, 2, piecewise_constant=[m.u])
    m.u[...].set_value(99.0)
    m.u[1].value, m.u[2].value = held_control.CONTROLS
    simulated(m)
    assert m.x[2].value == pytest.approx(0.3, abs=1e-7)
    assert {m.u[t].value for t in m.t if t <= 1} == {held_control.CONTROLS[0]}


@pytest.mark.parametrize('named', ['list', 'Var', 'fixed'])
def test_other_inputs_are_named_or_fixed(named):
    m = held_control.build()
    transform(m, 8, 2)
    for t in m.t:
        m.u[t].value = held_control.CONTROLS[0] if t <= 1 else held_control.CONTROLS[1]
    if named == 'fixed':
        m.u.fix()
    simulated(m, **{'list': {'inputs': [m.u]}, 'Var': {'inputs': m.u}, 'fixed': {}}[named])
    assert m.x[2].value == pytest.approx(0.3, abs=1e-7)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_threshold_that_jumps_between_stages(scheme):
    m = threshold.build()
    transform(m, 12, 2, piecewise_constant=[m.w], scheme=scheme)
    simulated(m)
    found = [(s.time, s.before, s.after) for s in pyomo_fesd.switches(m)]
    assert found == [(pytest.approx(t, abs=1e-7), a, b) for t, a, b in threshold.SWITCHES]
    assert m.x[3].value == pytest.approx(threshold.FINAL, abs=1e-7)


def test_controls_survive_a_second_pass():
    # more switches than the first pass expects: it is repeated with the same controls
    m = setpoints.build()
    move(dcs(m, hysteresis=[m.relay]), 9, 1, piecewise_constant=[m.w])
    simulated(m)
    assert times(m) == pytest.approx([t for t, _, _ in setpoints.SWITCHES], abs=1e-7)
    assert [m.w[t].value for t in setpoints.SETPOINTS] == list(setpoints.SETPOINTS.values())


def test_numbers_that_differ_from_stage_to_stage():
    m = scalar_ode(x0=0.0, end=2)
    m.t.add(1)
    rate = {0: 1.0, 1: 1.0, 2: -3.0}
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == (1.0 if t <= 1 else -3.0))
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.x[t])
    m.y[0].fix(0)
    simulated(move(m, 6, 2))
    assert (m.x[1].value, m.x[2].value) == (pytest.approx(rate[1]), pytest.approx(-2.0))


def test_mutable_params_count_as_they_are():
    m = scalar_ode(x0=0.0, end=2)
    m.a = pyo.Param(initialize=1.0, mutable=True)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.a)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    move(m, 3, 2)
    for a in (1.0, 5.0):
        m.a.value = a
        simulated(m)
        assert m.x[2].value == pytest.approx(2 * a)


def test_a_variable_without_time_keeps_its_value():
    m = scalar_ode(x0=0.0, end=2)
    m.T = pyo.Var(initialize=3.0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.T)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    simulated(move(m, 3, 2))
    assert m.x[2].value == pytest.approx(6.0) and m.T.value == 3.0


# Scales


@pytest.mark.parametrize('scale, scaled', [(1e-3, False), (1e3, False), (1e6, False), (1e-7, True), (1e7, True)])
def test_a_ball_in_other_units(scale, scaled):
    m = bouncing_ball.build()
    m.del_component(m.fall)
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -9.81 * scale)
    m.q[...].set_value(0.8 * scale)
    m.q[0].fix(0.8 * scale)
    if scaled:
        m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
        for v in (m.q, m.v, m.dq, m.dv):
            m.scaling_factor[v] = 1 / scale
    simulated(move(m, 10, 2))
    assert times(m) == pytest.approx(bouncing_ball.impacts(), abs=1e-6)
    q, v = bouncing_ball.end()
    assert (m.q[3].value / scale, m.v[3].value / scale) == (pytest.approx(q, abs=1e-5), pytest.approx(v, abs=1e-5))


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize('scale', [1e-9, 1e-4, 1e4, 1e6, 1e9])
def test_a_start_that_is_fast_beside_the_elements(scale, form):
    # x = scale (1 - exp(-10 t)) passes its half long before the first collocation point
    m = over_time(60, x=0, y=0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -10 * (m.x[t] - scale))
    m.half = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= scale / 2, m.dy[t] == 1], [m.x[t] >= scale / 2, m.dy[t] == -1]])
    timer = HierarchicalTimer()
    m = simulated(transform(m, 6, 3, form=form), timer=timer)
    assert times(m) == pytest.approx([log(2) / 10], rel=1e-4)
    if scale > 1e-9:  # where sides of 1e-9 count as zero, the MPCC decides
        assert 'mpcc' not in str(timer)  # Newton's method finds the arrival from the value at the first time


@pytest.mark.parametrize('by_newton', [True, False])
@pytest.mark.parametrize('scale', [1e-11, 1e-9, 1e-4, 1e4, 1e9])
def test_a_relay_in_other_units(scale, by_newton, monkeypatch):
    if not by_newton:
        monkeypatch.setattr(ElementClass, 'newton_step', lambda *_: None)
    m = scalar_ode(x0=0.0, end=4)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    m.relay = Disjunction(
        m.t,
        rule=lambda m, t: [[m.x[t] <= scale, m.dx[t] == scale], [m.x[t] >= -scale, m.dx[t] == -2 * scale]],
    )
    m.relay[0].disjuncts[0].indicator_var.fix(True)
    # no multiple of the length of an element is a switching time
    simulated(move(dcs(m, hysteresis=[m.relay]), 13, 1))
    assert times(m) == pytest.approx([1.0, 2.0], abs=1e-6)


# The model afterwards


def test_it_returns_the_trajectory_and_sets_the_indicators():
    m = thermostat.transform(thermostat.build(1), 6, 3)
    frame = pyomo_fesd.simulate(m)
    assert frame.equals(pyomo_fesd.trajectory(m))
    assert m.heating[0].indicator_var.value is True and m.cooling[1].indicator_var.value is True


@pytest.mark.parametrize('what', ['thermostat', 'ball', 'friction', 'controls'])
def test_nothing_but_values_changes(what):
    m = {
        'thermostat': lambda: thermostat.transform(thermostat.build(1), 6, 3),
        'ball': lambda: move(bouncing_ball.build(), 10, 2),
        'friction': lambda: transform(air_friction.build(), 10, 2),
        'controls': lambda: transform(held_control.build(), 8, 2),
    }[what]()
    inputs = [m.u] if what == 'controls' else []
    m.far = pyo.Var(m.t, within=pyo.NonNegativeReals, bounds=(None, 5), initialize=1)
    before = bare(m)
    simulated(m, inputs=inputs)
    assert bare(m) == before


def test_nothing_but_values_changes_where_it_fails():
    m = move(bouncing_ball.build(), 4, 2)
    before = bare(m)
    with pytest.raises(FesdError):
        simulated(m)
    assert bare(m) == before


def test_bounds_of_states_do_not_stop_it():
    m = scalar_ode(x0=0.0, end=2)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    for v in m.x.values():
        v.setub(1.0)
    m.cap = pyo.Constraint(m.t, rule=lambda m, t: m.x[t] <= 1.5)
    simulated(move(m, 4, 2))
    assert m.x[2].value == pytest.approx(2.0)
    assert m.x[2].ub == 1.0


def test_a_state_that_is_fixed_at_the_end_keeps_its_value_there():
    m = transform(signum.build(), 6, 2)
    m.x[2].fix(7.0)
    frame = pyomo_fesd.simulate(m)
    assert frame['x'].iloc[-1] == pytest.approx(signum.FINAL, abs=1e-7)
    assert m.x[2].value == 7.0 and m.x[2].fixed


def test_it_can_be_repeated_from_another_start():
    m = move(bouncing_ball.build(), 10, 2)
    for height in (0.8, 0.2):
        m.q[0].fix(height)
        simulated(m)
        assert times(m)[0] == pytest.approx((2 * height / 9.81) ** 0.5, abs=1e-7)


def test_a_clone_is_simulated_by_itself():
    m = thermostat.transform(thermostat.build(1), 6, 3)
    before = seen(m)
    copy = simulated(m.clone())
    assert times(copy) == pytest.approx(thermostat.switching_times(1), abs=1e-7)
    assert seen(m) == before


def test_the_model_is_a_start_for_all_elements_at_once():
    m = solve(simulated(thermostat.transform(thermostat.build(2), 10, 3)), warm_start=True)
    assert times(m) == pytest.approx(thermostat.switching_times(2), abs=1e-7)


def short_stretch(length):
    m = thermostat.transform(thermostat.build(thermostat.switching_times(2)[2] + length), 10, 3)
    simulated(m)
    return m


def test_an_interval_shorter_than_any_element_gives_a_warning(caplog):
    short_stretch(1e-7)
    (message,) = [r.getMessage() for r in caplog.records if 'least element length' in r.getMessage()]
    assert 'from time 1.62025 to 1.62025' in message and 'nfe' in message


def test_the_solver_follows_into_a_stretch_much_shorter_than_an_element(caplog):
    m = short_stretch(1e-3)
    found = m.y[m.t.last()].value
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B' and not caplog.records
    assert m.y[m.t.last()].value == pytest.approx(found, abs=1e-7)


# A contact that ends within one element


def test_a_guard_that_is_touched_between_two_points():
    # a ball over a floor that comes up and goes down again: contact within one of two elements
    m = scalar_ode(x0=1.0, end=4)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.y[t])
    m.brake = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 1)
    m.y[0].fix(-2.0)
    # x = 1 - 2 t + t^2/2 falls to zero at t = 2 - sqrt(2) and is positive again after 2 + sqrt(2)
    m.floor = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.x[t], reset=lambda m, t: [(m.y[t], -m.y[t])])
    simulated(move(m, 2, 3))
    assert times(m) == pytest.approx([2 - 2**0.5], abs=1e-7)


# Laws


@settings(max_examples=8, deadline=None)
@given(
    up=st.floats(0.5, 3),
    down=st.floats(0.5, 3),
    low=st.floats(-2, 0),
    gap=st.floats(1, 3),
    part=st.floats(0.1, 0.9),
)
def test_any_relay(up, down, low, gap, part):
    m = scalar_ode(x0=low + part * gap, end=4)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    m.relay = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= low + gap, m.dx[t] == up], [m.x[t] >= low, m.dx[t] == -down]])
    m.relay[0].disjuncts[0].indicator_var.fix(True)
    simulated(move(dcs(m, hysteresis=[m.relay]), 14, 1))
    exact, stretch = [(1 - part) * gap / up], [gap / down, gap / up]
    while exact[-1] < 4:
        exact.append(exact[-1] + stretch[(len(exact) - 1) % 2])
    assert times(m) == pytest.approx([t for t in exact if t < 4 - 1e-6], abs=1e-7)


# Zeno


def test_up_to_seven_two_tanks_are_simulated_exactly():
    m = two_tanks.build()
    simulated(move(dcs(m, hysteresis=m.hose), 12, 2))
    assert times(m) == pytest.approx(two_tanks.CHANGES, abs=1e-7)
    assert (m.x[1, 7].value, m.x[2, 7].value) == pytest.approx(two_tanks.LEVELS, abs=1e-7)
    solve(m, warm_start=True)
    assert (m.x[1, 7].value, m.x[2, 7].value) == pytest.approx(two_tanks.LEVELS, abs=1e-7)


@pytest.mark.parametrize('nfe', [10, 30])
def test_beyond_the_limit_the_message_names_it(nfe):
    m = two_tanks.build(10)
    move(dcs(m, hysteresis=m.hose), nfe, 2)
    with pytest.raises(FesdError, match=r'accumulate \(Zeno\): the last ones are at times .*, their limit is about 8\n'):
        simulated(m)


def test_a_ball_that_comes_to_rest():
    m = move(bouncing_ball.build(0.5, 2), 30, 2)
    with pytest.raises(FesdError, match=r'their limit is about 1.21157\n'):
        simulated(m)


# Refusals


def test_a_grid_that_does_not_move():
    m = dcs(signum.build())
    with pytest.raises(FesdError, match='simulate: its elements are not movable') as error:
        pyomo_fesd.simulate(m)
    assert 'fesd.finite_elements' in error.value.fix


def test_no_time():
    with pytest.raises(FesdError, match='simulate: the model has no ContinuousSet'):
        pyomo_fesd.simulate(pyo.ConcreteModel())


def test_several_times():
    m = transform(signum.build(), 4)
    m.s = dae.ContinuousSet(bounds=(0, 1))
    with pytest.raises(FesdError, match='simulate: the model has several ContinuousSets'):
        pyomo_fesd.simulate(m)
    pyomo_fesd.simulate(m, m.t)
    assert len(pyomo_fesd.switches(m, m.t)) == 1


@pytest.mark.parametrize('name', ['q', 'v'])
def test_a_state_that_is_not_fixed_at_the_first_time(name):
    m = move(bouncing_ball.build(), 10, 2)
    m.component(name)[0].unfix()
    with pytest.raises(FesdError, match=rf'{name}\[0\]: simulate: this state is neither fixed at the first time'):
        pyomo_fesd.simulate(m)


@pytest.mark.parametrize('how', ['holdup', 'rate'])
def test_a_state_that_equations_imply_at_the_first_time(how):
    # V' = 2 - h with h = V/3: from h = 1, or from the rate 1
    m = scalar_ode(end=2)
    m.x[0].unfix()
    m.h = pyo.Var(m.t, initialize=0.1)
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 2 - m.h[t])
    m.cylinder = pyo.Constraint(m.t, rule=lambda m, t: 3 * m.h[t] == m.x[t])
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    (m.h if how == 'holdup' else m.dx)[0].fix(1.0)
    simulated(move(m, 4, 3))
    assert m.x[0].value == pytest.approx(3.0) and not m.x[0].fixed
    assert m.x[2].value == pytest.approx(6 - 3 * exp(-2 / 3), abs=1e-5)


def test_a_control_that_is_not_named():
    m = transform(held_control.build(), 8, 2)
    with pytest.raises(FesdError, match=r'simulate: nothing determines .*or another variable in the same equations') as error:
        pyomo_fesd.simulate(m)
    assert 'inputs' in error.value.fix


def test_an_input_without_a_value():
    m = held_control.build()
    transform(m, 8, 2, piecewise_constant=[m.u])
    m.u[...].set_value(None)
    with pytest.raises(FesdError, match=r'u\[.*\]: simulate: it has no value'):
        pyomo_fesd.simulate(m)


def test_a_bound_that_is_reached():
    m = move(weir.build(), 6, 2)
    m.F.setub(0.5)
    with pytest.raises(FesdError, match='from time 0.7; where one is forced, largest residuals: balance'):
        pyomo_fesd.simulate(m)


def test_a_bound_at_one_time():
    m = move(weir.build(), 6, 2)
    m.F[2].setub(0.5)
    with pytest.raises(FesdError, match='from time 1.56667; where one is forced, largest residuals: overflow'):
        pyomo_fesd.simulate(m)


def test_no_mode_at_the_first_time():
    m = thermostat.build(1)
    m.heating[0].indicator_var.unfix()
    m.y[0].fix(19)
    with pytest.raises(FesdError, match='relay.*: simulate: 2 modes are possible at the first time') as error:
        pyomo_fesd.simulate(move(dcs(m, hysteresis=[m.relay]), 6, 3))
    assert 'indicator_var.fix(True), before fesd.dcs' in error.value.fix


def test_the_only_possible_mode_comes_first():
    m = thermostat.build(1)
    m.heating[0].indicator_var.unfix()
    simulated(move(dcs(m, hysteresis=[m.relay]), 6, 3))
    assert times(m) == pytest.approx(thermostat.switching_times(1), abs=1e-7)


def test_no_mode_can_follow():
    m = scalar_ode(x0=0.0, end=3)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    m.d = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.dx[t] == 1], [m.x[t] >= 2, m.dx[t] == -1]])
    with pytest.raises(FesdError, match=r'simulate: 0 modes can follow where this one ends \(none\)'):
        pyomo_fesd.simulate(move(dcs(m, hysteresis=m.d), 6, 2))


def test_several_modes_can_follow():
    m = scalar_ode(x0=0.0, end=3)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    m.d = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] <= 1, m.dx[t] == 1],
            [m.x[t] >= 0, m.dx[t] == -1],
            [m.x[t] >= -1, m.dx[t] == -2],
        ],
    )
    m.d[0].disjuncts[0].indicator_var.fix(True)
    with pytest.raises(FesdError, match='simulate: 2 modes can follow where this one ends') as error:
        pyomo_fesd.simulate(move(dcs(m, hysteresis=m.d), 6, 2))
    assert 'one other region' in error.value.fix


def test_equations_without_a_solution():
    m = scalar_ode(x0=1.0, end=2)
    m.z = pyo.Var(m.t, initialize=1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.z[t])
    m.root = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] ** 2 + m.x[t] == 0)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    with pytest.raises(FesdError, match='simulate: no solution at time 0: '):
        pyomo_fesd.simulate(move(m, 4, 2), max_iterations=50)


def test_an_unknown_option():
    m = transform(signum.build(), 4)
    with pytest.raises(ValueError, match='key'):
        pyomo_fesd.simulate(m, colour='red')


def test_options_reach_the_solver():
    # it starts where two modes meet, so a small problem with complementarity is solved
    m = signum.build()
    m.x[0].fix(0.0)
    transform(m, 4)
    called = []
    pyomo_fesd.simulate(m, callback=lambda progress: called.append(progress))
    assert called


def test_interrupted():
    m = signum.build()
    m.x[0].fix(0.0)
    transform(m, 4)
    before = bare(m)

    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pyomo_fesd.simulate(m, callback=stop)
    assert bare(m) == before


@pytest.mark.parametrize('x0', [sign * 10.0**-power for power in (12, 9, 7, 6, 5) for sign in (-1, 1)])
@pytest.mark.parametrize('below, above', [(3, 1), (1, -1)], ids=['crosses', 'slides'])
def test_a_start_near_a_surface(below, above, x0):
    m = over_time(2, x=x0)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == below], [m.x[t] >= 0, m.dx[t] == above]])
    pyomo_fesd.simulate(transform(m, 10, 2))
    expected = (2 + min(x0, 0) / 3 + max(x0, 0)) if above > 0 else 0
    # a start nearer than 1e-7 may count as on the surface, which shifts the solution by less than that
    assert m.x[2].value == pytest.approx(expected, abs=1e-7)


def test_a_given_state_that_jumps_is_named_where_no_step_is_found():
    """The state at the end of a pipe is an input, fixed to another value from the first point on; no flow a fits to its rate."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x, m.a = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x)
    m.law = pyo.Constraint(m.t, rule=lambda m, t: m.a[t] ** 2 == 5 - m.dx[t])
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    m.x.fix(9)
    m.x[0].fix(1)
    m.dx[0].fix(0)
    with pytest.raises(FesdError, match=r"(?s)the state 'x\[.*\]' is given, and jumps there from 1 to 9.*a state cannot jump"):
        pyomo_fesd.simulate(m)
    for t in m.t:
        m.x[t].fix(1 + 4 * t)
    pyomo_fesd.simulate(m)
    assert m.a[1].value == pytest.approx(1, abs=1e-5)  # labels have six decimals
