"""Time series as inputs: exact on physical time, whatever the elements do."""

import numpy as np
import pandas as pd
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.problems.running import LEGENDRE, RADAU, SCHEMES, move

KINDS = ('linear', 'stepped')


def switched(kind, times, values, horizon=(0, 2), **keywords):
    """x' = u below 0, 1 above; x = -2 at first."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=horizon)
    m.x = pyo.Var(m.t, initialize=-2)
    m.dx = dae.DerivativeVar(m.x)
    m.x[horizon[0]].fix(-2)
    m.u = pyomo_fesd.signal(m.t, times, values, kind=kind, **keywords)

    @m.Disjunct(m.t)
    def below(d, t):
        d.region = pyo.Constraint(expr=d.model().x[t] <= 0)
        d.ode = pyo.Constraint(expr=d.model().dx[t] == d.model().u[t])

    @m.Disjunct(m.t)
    def above(d, t):
        d.region = pyo.Constraint(expr=d.model().x[t] >= 0)
        d.ode = pyo.Constraint(expr=d.model().dx[t] == 1)

    @m.Disjunction(m.t)
    def sgn(m, t):
        return [m.below[t], m.above[t]]

    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    return m


def exact_switch(kind, times, values, start=0.0):
    """When the integral of the signal from ``start`` reaches 2."""
    lost, before = 2.0, start
    for a, b, u, v in zip(times, [*times[1:], np.inf], values, [*values[1:], values[-1]]):
        left, slope = max(a, before), 0.0 if kind == 'stepped' or b == np.inf else (v - u) / (b - a)
        if b <= left:
            continue
        now = u + slope * (left - a)
        length = b - left
        gain = np.inf if b == np.inf and now > 0 else now * length + slope * length**2 / 2
        if gain >= lost:
            return left + (lost / now if slope == 0 else (-now + np.sqrt(now**2 + 2 * slope * lost)) / slope)
        lost, before = lost - gain, b
    return None


def only_switch(m):
    (switch,) = pyomo_fesd.switches(m)
    return switch.time


@pytest.mark.parametrize('solver', ['simulate', 'mpec_hybrid', 'refine'])
@pytest.mark.parametrize('scheme, ncp', [(RADAU, 2), (RADAU, 3), (LEGENDRE, 2)])
@pytest.mark.parametrize('kind', KINDS)
def test_the_switch_is_exact(kind, scheme, ncp, solver):
    times, values = [0, 0.5, 1.1, 2], [0, 3, 1, 4]
    m = switched(kind, times, values)
    if solver == 'refine':
        assert pyomo_fesd.refine(m, 1e-6, ncp=ncp, scheme=scheme).reached
    else:
        move(m, nfe=9, ncp=ncp, scheme=scheme)
        pyomo_fesd.simulate(m) if solver == 'simulate' else pyo.SolverFactory('mpec_hybrid').solve(m)
    assert only_switch(m) == pytest.approx(exact_switch(kind, times, values), abs=1e-9)


@given(
    st.sampled_from(KINDS),
    st.lists(st.tuples(st.floats(0.05, 0.7), st.floats(0.3, 5)), min_size=2, max_size=6),
    st.sampled_from(SCHEMES),
)
@settings(max_examples=25, deadline=None)
def test_switches_are_exact_for_any_series(kind, steps, scheme):
    times, values = [0.0, *np.cumsum([h for h, _ in steps])], [1.0, *(v for _, v in steps)]
    times[-1] = max(times[-1], 2.1)
    exact = exact_switch(kind, times, values)
    m = switched(kind, times, values)
    pyomo_fesd.simulate(move(m, nfe=8, scheme=scheme))
    if exact is None or exact >= 2:
        assert not pyomo_fesd.switches(m)
    elif min(abs(exact - t) for t in [*times, 2]) > 1e-3:
        assert only_switch(m) == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize('kind', KINDS)
def test_values_are_those_of_physical_time(kind):
    times, values = [0, 0.5, 1.1, 2], [0, 3, 1, 4]
    m = switched(kind, times, values)
    pyomo_fesd.simulate(move(m, nfe=8))
    for t, physical in pyomo_fesd.physical_time(m).items():
        before = values[max(0, int(np.searchsorted(times, physical - 1e-9)) - 1)]
        expected = before if kind == 'stepped' else np.interp(physical, times, values)
        assert m.u[t].value == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    'arguments',
    [
        (pd.Series([0.0, 3, 1, 4], index=[0, 0.5, 1.1, 2]),),
        ({0: 0, 0.5: 3, 1.1: 1, 2: 4},),
        (np.array([0, 0.5, 1.1, 2]), np.array([0, 3, 1, 4])),
        ((0, 0.5, 1.1, 2), (v * pyo.units.m for v in [0, 3, 1, 4])),
    ],
    ids=['pandas', 'dictionary', 'numpy', 'units'],
)
def test_a_series_may_come_in_any_form(arguments):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.u = pyomo_fesd.signal(m.t, *arguments)
    assert list(m.t) == [0, 0.5, 1.1, 2] and [m.u[t].value for t in m.t] == [0, 3, 1, 4]


def test_values_are_converted_to_the_units_asked_for():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.u = pyomo_fesd.signal(m.t, [0, 1], [1 * pyo.units.km, 2000 * pyo.units.m], units=pyo.units.m)
    assert [m.u[t].value for t in m.t] == [1000, 2000] and str(m.u[0].get_units()) == 'm'


def test_points_without_effect_are_left_out():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 4))
    m.ramp = pyomo_fesd.signal(m.t, [0, 1, 2, 3, 4], [0, 1, 2, 2, 2])
    assert list(m.t) == [0, 2, 4]
    m.steps = pyomo_fesd.signal(m.t, [0, 1, 2, 3], [5, 5, 7, 7], kind='stepped')
    assert list(m.t) == [0, 2, 4]


@given(st.lists(st.floats(-5, 5), min_size=3, max_size=40), st.floats(0.01, 3))
@settings(deadline=None)
def test_a_thinned_series_stays_within_its_tolerance(values, tolerance):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    times = np.linspace(0, 1, len(values))
    m.u = pyomo_fesd.signal(m.t, times, values, tolerance=tolerance)
    points = list(m.t)
    assert np.abs(np.interp(times, points, [m.u[t].value for t in points]) - values).max() <= tolerance * (1 + 1e-9)


def test_a_breakpoint_is_no_boundary_of_a_control_stage():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x, m.c = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.u = pyomo_fesd.signal(m.t, [0, 0.4, 1.3], [1, 2, 3], kind='stepped')
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t] + m.c[t])
    m.goal = pyo.Objective(expr=(m.x[1] - 3) ** 2 + (m.x[2] - 2) ** 2)
    pyo.SolverFactory('mpec_hybrid').solve(move(m, nfe=6, ncp=1, piecewise_constant=[m.c]))
    assert {round(m.c[t].value, 6) for t in m.t} == {1.4, -3.7}


def test_elements_are_shared_by_length_and_two_at_least():
    m = switched('linear', [0, 0.1, 2], [0, 1, 0])
    move(m, nfe=10, ncp=1)
    assert sum(1 for t in m.t if 0 < t <= 0.1) == 2 and sum(1 for t in m.t if t > 0.1) == 8
    m = switched('linear', np.linspace(0, 2, 9), np.arange(9) ** 2)
    move(m, nfe=4, ncp=1)
    assert len(m.t) == 1 + 2 * 8


def test_a_point_beside_one_of_the_model_is_the_same():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 0.1 + 0.2, 1])
    m.u = pyomo_fesd.signal(m.t, [0, 0.3, 1], [0, 1, 0])
    assert list(m.t) == [0, 0.1 + 0.2, 1] and m.u[0.1 + 0.2].value == 1


def test_points_added_after_a_signal_have_its_values():
    m = switched('stepped', [0, 1], [1, 3])
    m.t.add(0.5)
    pyomo_fesd.simulate(move(m, nfe=8))
    assert only_switch(m) == pytest.approx(4 / 3, abs=1e-9)
    assert all(v.fixed for v in m.u.values())


def test_a_clone_has_signals_of_its_own():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x = pyo.Var(m.t, initialize=0)
    m.u = pyomo_fesd.signal(m.t, [0, 0.5, 1], [0, 1, 0])
    other = m.clone()
    other.dx = dae.DerivativeVar(other.x)
    other.x[0].fix(0)
    other.ode = pyo.Constraint(other.t, rule=lambda m, t: m.dx[t] == m.u[t])
    pyomo_fesd.simulate(move(other, nfe=4))
    assert other.x[1].value == pytest.approx(0.5, abs=1e-12) and list(m.t) == [0, 0.5, 1]


def test_a_set_point_may_jump():
    """A relay whose set point jumps from 1 to 2 at time 1.5: the mode changes there."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 3))
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.goal = pyomo_fesd.signal(m.t, [0, 1.5], [1, 2], kind='stepped')
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= m.goal[t], m.dx[t] == 1], [m.x[t] >= m.goal[t], m.dx[t] == -1]])
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyomo_fesd.simulate(move(m, nfe=8))
    assert m.x[3].value == pytest.approx(2, abs=1e-9)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([1, 1.5, 2.5], abs=1e-9)


@pytest.mark.parametrize(
    'arguments, keywords, message',
    [
        (([0, 1, 1, 2], [1, 2, 3, 4]), {}, 'time 1 follows 1'),
        (([0, 2, 1], [1, 2, 3]), {}, 'time 1 follows 2'),
        (([0, 1, 2], [1, 2]), {}, '3 times, but 2 values'),
        (([0, 1], [1, 2]), {}, 'do not cover the horizon from 0 to 2'),
        (([0.5, 3], [1, 2]), {'kind': 'stepped'}, 'do not cover the horizon'),
        (([0, 1, 2], [1, float('nan'), 2]), {}, 'values number 1 is not finite'),
        (([0, 1, 2], ['a', 'b', 'c']), {}, 'the values are no numbers'),
        (([0, 1, 2],), {}, 'there are no values'),
        (([0, 2], 3.0), {}, 'the values are 3.0'),
        (([0], [1]), {}, 'it has 1 points'),
        (([0, 2], [1, 2]), {'kind': 'cubic'}, "kind='cubic'"),
        (([0, 2], [1, 2]), {'tolerance': -1}, 'tolerance=-1'),
        (([0, 2], [1 * pyo.units.m, 2 * pyo.units.s]), {}, 'other units'),
        ((pd.Series([1.0, 2.0], index=pd.to_datetime(['2026-01-01', '2026-01-02'])),), {}, 'are dates'),
    ],
)
def test_what_is_no_series_is_refused(arguments, keywords, message):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    with pytest.raises(FesdError, match=message):
        pyomo_fesd.signal(m.t, *arguments, **keywords)
    assert list(m.t) == [0, 2]


def test_a_signal_comes_before_the_discretisation():
    m = switched('linear', [0, 2], [1, 2])
    move(m)
    with pytest.raises(FesdError, match='is discretised already'):
        m.late = pyomo_fesd.signal(m.t, [0, 2], [1, 2])


def test_something_else_than_a_time_set_is_refused():
    m = switched('linear', [0, 2], [1, 2])
    with pytest.raises(FesdError, match='not a ContinuousSet'):
        pyomo_fesd.signal(m.x, [0, 2], [1, 2])


def test_free_time_is_refused():
    m = switched('linear', [0, 2], [1, 2])
    m.T = pyo.Var(bounds=(1, 5), initialize=2)
    with pytest.raises(FesdError, match='a signal has given times'):
        move(m, final_time=m.T)
