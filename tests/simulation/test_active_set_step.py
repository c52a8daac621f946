"""Elements by Newton's method agree with the MPCC of the element, to the last digit of the discretised problem."""

from math import exp, log, sqrt

import bouncing_ball
import gas_liquid_tank
import numpy as np
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
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd.simulation import newton
from pyomo_fesd.simulation.element_class import ElementClass
from tests.models import scalar_ode
from tests.problems import (
    air_friction,
    clock,
    crossing,
    quadratic_drag,
    relay_of_states,
    resting_ball,
    sliding,
    threshold,
    two_systems,
    weir,
)
from tests.problems.running import LEGENDRE, RADAU, SCHEMES, move, transform
from tests.problems.states import over_time

FILIPPOV = {
    'tank': (gas_liquid_tank.build, 12),
    'oscillator': (oscillator.build, 30),
    'signum': (signum.build, 8),
    'sliding': (sliding.build, 8),
    'crossing': (crossing.build, 8),
    'clock': (clock.build, 8),
    'two_systems': (two_systems.build, 12),
}
OTHERS = {
    'thermostat': lambda: thermostat.transform(thermostat.build(), 15, 3),
    'ball': lambda: move(bouncing_ball.build(), 10, 2),
    'resting ball': lambda: move(resting_ball.build(), 10, 2),
    'friction and jumps': lambda: transform(air_friction.build(), 12, 3),
    'weir': lambda: move(weir.build(), 6, 2),
    'weirs in series': lambda: move(weir.build_series(), 8, 2),
    'curved': lambda: transform(sliding.build_curved(), 8, 3),
    'stewart': lambda: transform(gas_liquid_tank.build(), 12, 3, form='stewart'),
}


def leaving(scheme, nfe=10):
    """dx/dt = exp(s) - 1 - sgn x, ds/dt = 1: a slide from x = 0 on that is left smoothly at s = log 2."""
    m = over_time(2.0, x=0)
    s = pyomo_fesd.clock(m)
    m.sgn = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] <= 0, m.dx[t] == pyo.exp(s[t])],
            [m.x[t] >= 0, m.dx[t] == pyo.exp(s[t]) - 2],
        ],
    )
    return transform(m, nfe, 3, scheme=scheme)


def calls(timer, name):
    """How often a phase of the simulation was entered, without the first time."""
    found = timer.timers['simulate'].timers['march'].timers
    return found[name].n_calls if name in found else 0


def simulated(m):
    """The model after a simulation, and its timer."""
    timer = HierarchicalTimer()
    pyomo_fesd.simulate(m, timer=timer)
    return m, timer


def states(m):
    """Values of everything over time that the user has."""
    frame = pyomo_fesd.trajectory(m)
    return frame[[c for c in frame.columns if frame[c].dtype == float]].to_numpy()


def solved_as_a_whole(m):
    """Largest difference of the solution of all elements at once from the simulation, relative to lengths and sizes of values."""
    lengths, values = list(pyomo_fesd.element_lengths(m)['length']), states(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B'
    far = np.abs(pyomo_fesd.element_lengths(m)['length'] / lengths - 1).max()
    return max(far, np.nanmax(np.abs(states(m) - values) / np.maximum(1, np.nanmax(np.abs(values), axis=0))))


# No complementarity is solved, and the result is that of the full problem


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('name', FILIPPOV)
def test_the_simulation_solves_the_full_problem(name, scheme):
    build, nfe = FILIPPOV[name]
    m, timer = simulated(transform(build(), nfe, 3, scheme=scheme))
    assert calls(timer, 'mpcc') == 0
    assert solved_as_a_whole(m) <= 1e-8


@pytest.mark.parametrize('name', OTHERS)
def test_it_does_so_with_hysteresis_jumps_and_hand_written_conditions(name):
    m, timer = simulated(OTHERS[name]())
    assert calls(timer, 'mpcc') == 0
    assert solved_as_a_whole(m) <= 1e-8


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_slide_that_is_left_smoothly(scheme):
    m, timer = simulated(leaving(scheme))
    assert calls(timer, 'mpcc') == 0
    # Radau's multiplier is exact at the end of the slide; Gauss' by its polynomial (theory, eq. 13a)
    assert pyomo_fesd.switches(m)[-1].time == pytest.approx(log(2), abs={RADAU: 1e-12, LEGENDRE: 1e-4}[scheme])
    assert m.x[2].value == pytest.approx(exp(2) - 6 + 2 * log(2), abs=1e-6)
    assert solved_as_a_whole(m) <= 1e-8


def test_times_and_end_of_the_tank():
    m, _ = simulated(transform(gas_liquid_tank.build(), 40, 3))
    found = gas_liquid_tank.found(m)
    assert found['t_s'] == pytest.approx(gas_liquid_tank.EXACT['t_s'], abs=1e-10)
    assert found['M_G'] == pytest.approx(gas_liquid_tank.EXACT['M_G'], rel=1e-8)


def test_equal_lengths_only_where_they_are_asked_for():
    lengths = {}
    for mode in ('two_stage', 'none'):
        m, _ = simulated(transform(gas_liquid_tank.build(), 12, 3, equilibration=mode))
        lengths[mode] = pyomo_fesd.element_lengths(m)['length'].round(9).nunique()
    # before and after the switch; else one more, cut short
    assert lengths == {'two_stage': 2, 'none': 3}


# The same as by the MPCC of each element


SYSTEMS = {name: lambda build=build, nfe=nfe: transform(build(), nfe, 3) for name, (build, nfe) in FILIPPOV.items()} | OTHERS
SYSTEMS['nonsmooth term'] = lambda: move(quadratic_drag.build(8, 3), 8, 3)
SYSTEMS['relay of states'] = lambda: transform(relay_of_states.build(), 8, 3)
SYSTEMS['threshold'] = lambda m=None: transform(m := threshold.build(), 12, 2, piecewise_constant=[m.w])


# tests of the problems themselves have exact answers for the others
@pytest.mark.parametrize(
    'name', ['signum', 'sliding', 'curved', 'friction and jumps', 'weirs in series', 'stewart', 'nonsmooth term', 'threshold']
)
def test_mpccs_alone_find_the_same(name, monkeypatch):
    fast, slow = SYSTEMS[name](), SYSTEMS[name]()
    simulated(fast)
    monkeypatch.setattr(ElementClass, '_stepper', None)
    _, timer = simulated(slow)
    assert calls(timer, 'newton') == 0 and calls(timer, 'mpcc') > 0
    found, known = (pyomo_fesd.switches(m) for m in (fast, slow))
    assert [s.time for s in found] == pytest.approx([s.time for s in known], abs=1e-6)
    assert [(s.disjunction, s.after) for s in found] == [(s.disjunction, s.after) for s in known]
    assert states(fast)[-1] == pytest.approx(states(slow)[-1], abs=1e-5, nan_ok=True)


@settings(max_examples=8, deadline=None)
@given(
    x=st.floats(-2, 2).filter(lambda x: abs(x) > 1e-2),
    y=st.floats(-2, 2).filter(lambda y: abs(y) > 1e-2),
    rates=st.lists(st.floats(0.3, 2), min_size=4, max_size=4),
)
def test_two_surfaces_that_attract(x, y, rates):
    # dx/dt and dy/dt point to zero with rates of their own on either side: both slide in the end, at times known by hand
    m = over_time(8.0, x=x, y=y)
    for name, (down, up) in (('x', rates[:2]), ('y', rates[2:])):
        state, rate = m.component(name), m.component('d' + name)
        rule = lambda m, t, s=state, d=rate, a=up, b=down: [[s[t] <= 0, d[t] == a], [s[t] >= 0, d[t] == -b]]  # noqa: E731
        m.add_component('side_' + name, Disjunction(m.t, rule=rule))
    m, timer = simulated(transform(m, 6, 2))
    exact = sorted(v / rates[i] if v > 0 else -v / rates[i + 1] for v, i in ((x, 0), (y, 2)))
    assert calls(timer, 'mpcc') == 0
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([t for t in exact if t < 8], abs=1e-9)
    nu = pyomo_fesd.trajectory(m).iloc[-1]
    for name, i in (('x', 0), ('y', 2)):
        if (x if name == 'x' else y) and exact[-1] < 8:
            assert nu[f'side_{name}: mode 2'] == pytest.approx(rates[i + 1] / (rates[i] + rates[i + 1]), abs=1e-9)


# Large systems, and those that Newton's method cannot solve


def chain(number, nfe):
    """Levels that rise to their weirs one after the other, at t = 1/4 + k/(2 number)."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 4))
    m.k = pyo.RangeSet(number)
    m.x = pyo.Var(m.k, m.t, initialize=lambda m, k, t: -0.5 * k / number - 0.25)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.q = pyo.Var(m.k, m.t, initialize=0, bounds=(0, None))
    for k in m.k:
        m.x[k, 0].fix()
    m.balance = pyo.Constraint(m.k, m.t, rule=lambda m, k, t: m.dx[k, t] == 1 - m.q[k, t])
    m.weir = Complementarity(m.k, m.t, rule=lambda m, k, t: complements(m.q[k, t] >= 0, -m.x[k, t] >= 0))
    return move(m, nfe, 2)


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
def test_the_other_mode_of_one_of_many_systems(form):
    # levels reach 0 at k/12, the seventh with the eighth, and rise half as fast above it
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1.25))
    m.k = pyo.RangeSet(12)
    arrivals = {k: (8 if k == 7 else k) / 12 for k in m.k}
    m.x = pyo.Var(m.k, m.t, initialize=lambda m, k, t: -arrivals[k])
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for k in m.k:
        m.x[k, 0].fix()
    m.weir = Disjunction(m.k, m.t, rule=lambda m, k, t: [[m.x[k, t] <= 0, m.dx[k, t] == 1], [m.x[k, t] >= 0, m.dx[k, t] == 0.5]])
    m, timer = simulated(transform(m, 24, 2, form=form))
    assert calls(timer, 'mpcc') == 0
    assert sorted({round(s.time, 9) for s in pyomo_fesd.switches(m)}) == pytest.approx(sorted(set(arrivals.values())), abs=1e-8)
    assert [m.x[k, 1.25].value for k in m.k] == pytest.approx([(1.25 - arrivals[k]) / 2 for k in m.k], abs=1e-8)


@pytest.mark.parametrize('dense', [True, False])
def test_dense_and_sparse_factors_find_the_same(dense, monkeypatch):
    monkeypatch.setattr(newton, 'DENSE', 10**6 if dense else 0)
    m, timer = simulated(chain(4, nfe=12))
    assert calls(timer, 'mpcc') == 0
    assert sorted(s.time for s in pyomo_fesd.switches(m)) == pytest.approx([0.375, 0.5, 0.625, 0.75], abs=1e-10)
    assert [m.q[k, 4].value for k in m.k] == pytest.approx([1.0] * 4)


def test_more_rows_than_unknowns_on_a_slide_by_gauss(monkeypatch):
    for dense in (10**6, 0):
        monkeypatch.setattr(newton, 'DENSE', dense)
        m, timer = simulated(transform(sliding.build(), 8, 2, scheme=LEGENDRE))
        assert calls(timer, 'mpcc') == 0
        assert m.x[1.5].value == pytest.approx(0, abs=1e-12)


def test_conditions_that_begin_after_the_first_time():
    """dx/dt = max(0, 1 - x) - x/2 after the first time only, x = (2/3)(1 - exp(-3 t/2))."""
    m = over_time(1.0, x=0)
    m.u = pyo.Var(m.t, initialize=0)

    def part(m, t):
        return Complementarity.Skip if t == 0 else complements(m.u[t] >= 0, m.u[t] >= 1 - m.x[t])

    m.part = Complementarity(m.t, rule=part)
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: pyo.Constraint.Skip if t == 0 else m.dx[t] == m.u[t] - m.x[t] / 2)
    m, timer = simulated(transform(m, 4, 3))
    assert calls(timer, 'mpcc') == 0
    assert m.x[1].value == pytest.approx(2 / 3 * (1 - exp(-1.5)), abs=1e-6)


def test_where_newton_fails_the_mpcc_is_solved():
    # the ends of Gauss' elements leave the derivatives of two complementary states open
    m, timer = simulated(transform(relay_of_states.build(), 8, 3, scheme=LEGENDRE))
    assert calls(timer, 'mpcc') > 0
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([relay_of_states.SWITCH], abs=1e-7)


@pytest.mark.parametrize('cross', ['point', 'full'])
def test_other_forms_of_cross_complementarity(cross):
    m, timer = simulated(transform(two_systems.build(), 12, 2, cross_complementarity=cross))
    assert calls(timer, 'mpcc') == 0
    assert solved_as_a_whole(m) <= 1e-8


# Warnings and bounds


def test_a_start_from_which_both_modes_lead_away_gives_a_warning(caplog):
    m = over_time(1.5, x=0)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == -1], [m.x[t] >= 0, m.dx[t] == 1]])
    simulated(transform(m, 6, 2))
    assert any('not unique' in r.getMessage() for r in caplog.records)


def thrown(x=-1.999, v=2.0):
    """A throw x = -1.999 + 2 t - t^2/2, which is above zero for 0.09 about t = 2."""
    m = over_time(4.0, x=x, v=v, z=0.0)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -1)
    return m


ABOVE = 2 * sqrt(2e-3)
ARRIVES = 2 - ABOVE / 2


@pytest.mark.parametrize('nfe', [3, 4, 7, 20])
def test_a_region_entered_and_left_between_two_points_is_found(nfe, caplog):
    m = thrown()
    m.up = Disjunction(m.t, rule=lambda m, t: [[m.x[t] >= 0, m.dz[t] == 1], [m.x[t] <= 0, m.dz[t] == 0]])
    simulated(transform(m, nfe, 3))
    assert m.z[4].value == pytest.approx(ABOVE, abs=1e-9) and not caplog.records


@pytest.mark.parametrize('nfe', [3, 4, 7, 20])
def test_a_mode_with_hysteresis_ends_between_two_points(nfe, caplog):
    m = thrown()
    m.latch = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dz[t] == 0], [m.dz[t] == 1]])
    m.latch[0].disjuncts[0].indicator_var.fix(True)
    pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.latch])
    simulated(move(m, nfe, 3))
    assert m.z[4].value == pytest.approx(4 - ARRIVES, abs=1e-9) and not caplog.records


@pytest.mark.parametrize('nfe', [3, 4, 7, 20])
def test_a_state_jumps_between_two_points(nfe, caplog):
    m = thrown()
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dz[t] == 0)
    m.ceiling = pyomo_fesd.state_jump(m.t, guard=lambda m, t: -m.x[t], reset=lambda m, t: [(m.v[t], -m.v[t])])
    simulated(move(m, nfe, 3))
    left = 4 - ARRIVES
    assert m.x[4].value == pytest.approx(-ABOVE / 2 * left - left**2 / 2, abs=1e-9) and not caplog.records


def test_a_bound_of_another_variable_is_respected():
    m = scalar_ode(x0=0.0, end=2)
    m.z = pyo.Var(m.t, initialize=0, bounds=(None, 1))
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1)
    m.same = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == m.x[t])
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(0)
    with pytest.raises(pyomo_fesd.FesdError, match='simulate: no step is possible from time 1;'):
        pyomo_fesd.simulate(move(m, 4, 2))


def test_phases_are_on_the_timer():
    _, timer = simulated(transform(signum.build(), 8, 3))
    whole = timer.timers['simulate']
    assert set(whole.timers) == {'read', 'march', 'review', 'trajectory'}
    assert {'begin', 'compile', 'newton'} <= set(whole.timers['march'].timers)


def test_elements_of_a_class_are_compiled_once():
    _, timer = simulated(transform(gas_liquid_tank.build(), 30, 3))
    assert calls(timer, 'compile') == 1 and calls(timer, 'newton') == 60


def bump(horizon):
    """Slides with the fraction 1/2 + 3/5 exp(-4 (t - 1)^2), which is above 1 from t_s on, and below 1 again after 2 - t_s."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, horizon))
    m.tau = pyomo_fesd.clock(m.t)
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.feed = pyo.Expression(m.t, rule=lambda m, t: 0.5 + 0.6 * pyo.exp(-4 * (m.tau[t] - 1) ** 2))
    m.outlet = Disjunction(
        m.t,
        rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == m.feed[t]], [m.x[t] >= 0, m.dx[t] == m.feed[t] - 1]],
    )
    transform(m, nfe=10, ncp=2)
    return m


@pytest.mark.parametrize('horizon', [11.8, 12.0, 12.12, 12.134])
def test_a_slide_ends_at_the_first_of_two_zeros_in_an_element(horizon):
    # from the end of the first element Newton's method finds the zero beyond it, where the fraction is below 1 again
    m = bump(horizon)
    pyomo_fesd.simulate(m)
    leaves, returns = pyomo_fesd.switches(m)
    assert leaves.time == pytest.approx(1 - sqrt(log(1.2) / 4), abs=1e-9)
    assert (leaves.after, returns.before) == ('mode 2', 'mode 2')
