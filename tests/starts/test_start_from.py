"""Start values from a trajectory: round trips, what follows from some columns, coarser grids, controls, jumps, errors."""

import bouncing_ball
import gearbox_car
import numpy as np
import pandas as pd
import pump_curve
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
import thermostat
from pyomo.contrib.piecewise import PiecewiseLinearFunction

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.problems import air_friction, contacts, crossing, held_control, relay_of_states, sliding, two_systems, weir
from tests.problems.running import LEGENDRE, RADAU, lengths, move, seen, transform

CERTAIN = {'simulate_first': False, 'warm_start': True}


def iterations(m):
    results = pyo.SolverFactory('mpec_hybrid').solve(m, **CERTAIN)
    assert pyo.check_optimal_termination(results), results.solver.message
    return results.solver.nlp_iterations


def differences(m, frame, wrt=None):
    """Largest difference of each column; both have the same rows."""
    now = pyomo_fesd.trajectory(m, wrt)
    assert list(now.columns) == list(frame.columns) and len(now) == len(frame)
    return np.nanmax(np.abs(now.values - frame.values))


def ball(nfe=24):
    return move(bouncing_ball.build(), nfe, ncp=2)


PROBLEMS = {
    'signum': lambda nfe, scheme: transform(signum.build(), nfe, scheme=scheme),
    'stewart': lambda nfe, scheme: transform(signum.build(), nfe, form='stewart', scheme=scheme),
    'crossing': lambda nfe, scheme: transform(crossing.build(), nfe, scheme=scheme),
    'sliding': lambda nfe, scheme: transform(sliding.build(), nfe, scheme=scheme),
    'two_systems': lambda nfe, scheme: transform(two_systems.build(), nfe, scheme=scheme),
    'weir': lambda nfe, scheme: transform(weir.build(), nfe, scheme=scheme),
    'air_friction': lambda nfe, scheme: transform(air_friction.build(), nfe, scheme=scheme),
    'relay_of_states': lambda nfe, scheme: transform(relay_of_states.build(), nfe, scheme=scheme),
    'pump_curve': lambda nfe, scheme: transform(pump_curve.build(), nfe, scheme=scheme),
}

#: At the first time the states leave values open: two equations for two unknowns, or one for two.
IMPLICIT = ('pump_curve', 'relay_of_states')


@pytest.fixture(scope='module')
def bounced():
    m = ball()
    pyomo_fesd.simulate(m)
    return m


@pytest.mark.parametrize('scheme', [RADAU, LEGENDRE])
@pytest.mark.parametrize('name', PROBLEMS)
def test_a_whole_trajectory_gives_all_values_and_its_states_give_the_others(name, scheme):
    build = PROBLEMS[name]
    m = build(8, scheme)
    pyomo_fesd.simulate(m)
    frame, fresh, from_states = pyomo_fesd.trajectory(m), build(8, scheme), build(8, scheme)
    pyomo_fesd.start_from(fresh, frame)
    assert differences(fresh, frame) < 1e-10
    # a simulation that does not equalise lengths leaves something to do
    left = iterations(m)
    assert iterations(fresh) == left
    if name not in IMPLICIT:
        states = [d.get_state_var().local_name for d in fresh.component_objects(pyo.Var) if isinstance(d, dae.DerivativeVar)]
        pyomo_fesd.start_from(from_states, frame[['element', *states]])
        assert differences(from_states, frame) < 1e-10
        assert iterations(from_states) == left


def test_elements_end_at_the_jumps_of_a_table_of_the_users_own(bounced):
    frame, m = pyomo_fesd.trajectory(bounced)[['q', 'v']], ball()
    pyomo_fesd.start_from(m, frame)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(bouncing_ball.impacts(), abs=1e-9)
    assert iterations(m) < 20


@pytest.mark.parametrize('nfe', [24, 48])
def test_state_jumps(bounced, nfe):
    m = ball(nfe)
    pyomo_fesd.start_from(m, bounced)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(bouncing_ball.impacts(), abs=1e-9)
    if nfe == 24:
        assert differences(m, pyomo_fesd.trajectory(bounced)) < 1e-10
        assert iterations(m) == 0


CONTACTS = {
    'bounces': (lambda: contacts.ball(0.8, 1.5), 6),
    'rests': (lambda: contacts.ball(0), 4),
    'a row of blocks': (lambda: contacts.blocks(0.5), 6),
    'friction at an impact': (lambda: contacts.incline(0.2, height=0.4), 6),
    'friction in space': (lambda: contacts.puck(0.2), 6),
}


@pytest.mark.parametrize('states', [False, True])
@pytest.mark.parametrize('name', CONTACTS)
def test_impulses_follow_from_the_jumps_of_velocities(name, states):
    build, nfe = CONTACTS[name]
    m = move(build(), nfe)
    frame = source = pyomo_fesd.simulate(m)
    if states:
        kept = {c.split('[')[0] for c in frame.columns if m.find_component('d' + c.split('[')[0]) is not None}
        source = frame[[c for c in frame.columns if c.split('[')[0] in kept | {'element', 'label'}]]
    again = move(build(), nfe)
    pyomo_fesd.start_from(again, source)
    assert iterations(again) == 0
    assert differences(again, frame) < 1e-8


def test_hysteresis():
    m, fresh, finer = (thermostat.transform(thermostat.build(), nfe) for nfe in (15, 15, 30))
    pyomo_fesd.simulate(m)
    frame = pyomo_fesd.trajectory(m)
    pyomo_fesd.start_from(fresh, frame)
    assert differences(fresh, frame) < 1e-10
    assert iterations(fresh) == 0
    pyomo_fesd.start_from(finer, m)
    assert [s.time for s in pyomo_fesd.switches(finer)] == pytest.approx(thermostat.switching_times(), abs=1e-6)


@pytest.mark.parametrize('elements', [3, 6])
def test_a_model_gives_its_variables_without_time_too(car, elements):
    m = gearbox_car.transform(gearbox_car.build(gearbox_car.BEST_STAGES), elements)
    pyomo_fesd.start_from(m, car)
    assert m.T.value == car.T.value
    assert iterations(m) < 40
    assert m.T.value == pytest.approx(gearbox_car.T_BEST, rel=1e-7)


@pytest.fixture(scope='module')
def car():
    return gearbox_car.solve(gearbox_car.BEST_STAGES)[0]


def test_the_trajectory_of_a_relaxation_is_a_start():
    m, fresh = (transform(signum.build(), 10) for _ in range(2))
    pyo.SolverFactory('mpec_hybrid').solve(m, mode='relaxation', simulate_first=False)
    pyomo_fesd.start_from(fresh, pyomo_fesd.trajectory(m))
    assert [fresh.x[t].value for t in fresh.t] == pytest.approx([m.x[t].value for t in m.t])
    assert iterations(fresh) < 30


def test_a_finer_grid_has_the_switches_of_the_coarser_one_as_boundaries():
    m, fresh = transform(signum.build(), 4), transform(signum.build(), 9)
    pyomo_fesd.simulate(m)
    pyomo_fesd.start_from(fresh, m)
    assert min(abs(pyomo_fesd.element_lengths(fresh)['end'] - signum.SWITCH)) < 1e-9
    assert iterations(fresh) < 20


def test_lengths_stay_where_the_table_is_smooth_or_has_more_intervals_than_elements():
    m, fresh = transform(signum.build(), 8), transform(signum.build(), 4)
    pyomo_fesd.simulate(m)
    for frame in (pyomo_fesd.trajectory(m), pyomo_fesd.trajectory(m)[['x']]):
        pyomo_fesd.start_from(fresh, frame)
        assert lengths(fresh) == pytest.approx([0.5] * 4)
        assert fresh.x[0.5].value == pytest.approx(-0.5)


def controlled():
    m = held_control.build()
    return transform(m, 8, piecewise_constant=[m.u])


def test_a_held_control_gets_the_mean_over_its_stage_of_rows_that_hold_since_the_row_before():
    m = controlled()
    pyomo_fesd.start_from(m, pd.DataFrame({'u': [0.9, 0.2, 0.6, 1.0]}, index=[0, 0.5, 1, 2]))
    assert {round(m.u[t].value, 12) for t in m.t if t <= 1} == {0.4}
    assert {m.u[t].value for t in m.t if t > 1} == {1.0}


def test_controls_then_a_march():
    m = controlled()
    pyomo_fesd.start_from(m, pd.DataFrame({'u': held_control.CONTROLS}, index=[1, 2]))
    frame = pyomo_fesd.simulate(m)
    assert frame['x'].iloc[-1] == pytest.approx(0.3)
    assert iterations(m) < 30


def test_bounds_and_fixed_variables():
    m = controlled()
    pyomo_fesd.start_from(m, pd.DataFrame({'u': [5.0, 5.0], 'x': [1.0, 1.0]}, index=[0, 2]))
    assert {m.u[t].value for t in m.t} == {1.2}
    assert m.x[0].value == -4.5 and m.x[1].value == 1.0


def test_a_table_that_ends_early_goes_on_with_its_last_value():
    m = transform(signum.build(), 4)
    pyomo_fesd.start_from(m, pd.DataFrame({'x': [-2.0, -1.0]}, index=[0.0, 1.0]))
    assert m.x[0.5].value == pytest.approx(-1.5) and m.x[2].value == -1.0
    assert m.dx[0.5].value == pytest.approx(1.0)


def test_a_free_final_time_is_that_of_the_table():
    m = pyo.ConcreteModel()
    m.t, m.T = dae.ContinuousSet(bounds=(0, 1)), pyo.Var(bounds=(0.1, 9), initialize=1)
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 2)
    move(m, 4, final_time=m.T)
    pyomo_fesd.start_from(m, pd.DataFrame({'x': [0.0, 6.0]}, index=[0.0, 3.0]))
    assert m.T.value == 3 and m.x[0.5].value == pytest.approx(3.0) and m.dx[1].value == pytest.approx(2.0)


def test_one_of_several_sets():
    m = pyo.ConcreteModel()
    m.s, m.t = dae.ContinuousSet(bounds=(0, 1)), dae.ContinuousSet(bounds=(0, 2))
    m.x, m.y = pyo.Var(m.s, initialize=0), pyo.Var(m.t, initialize=0)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 1)
    m.other = pyo.Constraint(m.s, rule=lambda m, s: m.dx[s] == 1)
    for wrt in (m.s, m.t):
        move(m, 4, wrt=wrt)
    with pytest.raises(FesdError, match='say which one with the keyword wrt'):
        pyomo_fesd.start_from(m, pd.DataFrame({'y': [3.0]}, index=[0.0]))
    pyomo_fesd.start_from(m, pd.DataFrame({'y': [3.0]}, index=[0.0]), m.t)
    assert m.y[1].value == 3 and m.x[0.5].value == 0


def test_a_sliding_multiplier_follows_from_the_equation_of_the_state():
    m = transform(sliding.build(), 6)
    pyomo_fesd.start_from(m, pd.DataFrame({'x': [-0.5, 0.0, 0.0]}, index=[0.0, 0.5, 1.5]))
    frame = pyomo_fesd.trajectory(m)
    assert frame['friction: rising'].iloc[-1] == pytest.approx(sliding.NU)
    assert frame['friction: rising'].iloc[1] == 1


def test_weights_of_a_triangulation_follow_from_their_arguments():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x, m.y, m.z = (pyo.Var(m.t, initialize=0.1) for _ in range(3))
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.table = PiecewiseLinearFunction(points=[(a, b) for a in (0, 1, 2) for b in (0, 1, 2)], function=lambda a, b: a * b)
    m.value = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == m.table(m.x[t], m.y[t]))
    m.ode = pyo.Constraint(m.t, [1, 2], rule=lambda m, t, i: (m.dx if i == 1 else m.dy)[t] == i)
    transform(m, 4)
    pyomo_fesd.start_from(m, pd.DataFrame({'x': [0.0, 1.0], 'y': [0.0, 2.0]}, index=[0.0, 1.0]))
    assert [m.z[t].value for t in m.t] == pytest.approx([m.table(m.x[t].value, m.y[t].value) for t in m.t])


def table(**columns):
    return pd.DataFrame(columns, index=[0.0, 1.0, 2.0][: len(next(iter(columns.values())))])


BAD = {
    'name': (table(z=[1, 2]), r"z: start_from: the model has no variable over time of this name\n.*x, dx, sgn: below"),
    'missing': (table(x=[1, np.nan]), 'its value at time 1 is nan'),
    'order': (table(x=[1, 2, 3]).iloc[[1, 0, 2]], 'time 0 comes after 1'),
    'no time': (table(x=[1, 2]).set_axis([0, np.nan]), 'a time that is not a number'),
    'no number': (table(x=['a', 'b']), 'values that are not numbers'),
    'words': (table(x=[1, 2]).set_axis(['a', 'b']), 'the index: start_from: it has values that are not numbers'),
    'late': (table(x=[1, 2]).set_axis([0, 2.5]), 'time 2.5, outside of the horizon from 0 to 2'),
    'early': (table(x=[1, 2]).set_axis([-1, 2]), 'time -1, outside of the horizon from 0 to 2'),
    'empty': (table(x=[1, 2]).iloc[:0], 'no rows'),
    'twice': (pd.DataFrame([[1, 2]], columns=['x', 'x']), 'two columns have this title'),
    'a list': ([1, 2], 'a list is neither a table nor a model'),
    'another model': (pyo.ConcreteModel(), "it has no ContinuousSet 't'"),
}


@pytest.mark.parametrize('case', BAD)
def test_what_is_refused_leaves_the_model_unchanged(case):
    source, message = BAD[case]
    m = transform(signum.build(), 4)
    before = seen(m)
    with pytest.raises(FesdError, match=message):
        pyomo_fesd.start_from(m, source)
    assert seen(m) == before


def test_a_model_without_elements_is_refused():
    with pytest.raises(FesdError, match='its elements are not movable'):
        pyomo_fesd.start_from(signum.build(), table(x=[1, 2]))


def test_a_model_without_common_names_is_refused():
    other = pyo.ConcreteModel()
    other.t = dae.ContinuousSet(bounds=(0, 1))
    other.w = pyo.Var(other.t)
    with pytest.raises(FesdError, match='no variable over time that the model has'):
        pyomo_fesd.start_from(transform(signum.build(), 4), other)
