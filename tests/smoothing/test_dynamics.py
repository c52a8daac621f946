"""Nonsmooth terms over time, solved: exact times and values, the whole path."""

import logging
from math import exp, pi, sin, sqrt

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import saturating_valve
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError, absolute, clip, maximum, minimum, positive_part
from tests.smoothing.support import conditions, exact, smooth_abs, smooth_max, smooth_min

RADAU, GAUSS = 'LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE'


def state(end=2.0, x0=0.0, points=()):
    """One state over [0, end]."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, *points, end])
    m.x = pyo.Var(m.t, initialize=x0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(x0)
    return m


def solved(m, **keywords):
    """Discretise, solve, certified."""
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, **keywords)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    return m


def boundary(m, time):
    """Distance of the nearest element boundary from ``time``."""
    return np.abs(pyomo_fesd.element_lengths(m)['start'] - time).min()


# x' = 1 - 2 max(0, x - 1): x = t until 1, then 1 + (1 - exp(-2 (t - 1)))/2

BRAKED_END = 1 + (1 - exp(-2)) / 2


def braked(way):
    m = state()
    if way == 'function':

        @m.Block(m.t)
        def brake(b, t):
            m = b.model()
            b.ode = pyo.Constraint(expr=m.dx[t] == 1 - 2 * maximum(b, 0, m.x[t] - 1))

    elif way == 'positive part':
        m.force = pyo.Block(m.t)
        for t in m.t:
            m.force[t].brake = pyo.Expression(expr=positive_part(m.force[t], m.x[t] - 1))
        m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1 - 2 * m.force[t].brake)
    else:
        z = {'abs': lambda z: z + abs(z), 'smooth': lambda z: z + smooth_abs(z), 'idaes': lambda z: 2 * smooth_max(z, 0)}[way]
        m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1 - z(m.x[t] - 1))
    return m


@pytest.mark.parametrize('way', ['function', 'abs', 'smooth', 'idaes'])
@pytest.mark.parametrize('first', ['transformed', 'discretised'])
def test_a_brake_that_sets_in_is_exact_however_it_is_written(way, first):
    m = braked(way)
    if way != 'function' and first == 'transformed':
        exact(m)
    if first == 'discretised':
        pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=12, ncp=3)
        exact(m)
    solved(m, nfe=12, ncp=3)
    assert boundary(m, 1) < 1e-9
    # the rest is the quadrature of the scheme, order 5, after the brake has set in
    assert m.x[2].value == pytest.approx(BRAKED_END, abs=2e-6)


def test_a_block_filled_by_hand_after_discretisation():
    m = state()
    pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=12, ncp=3)
    m.force = pyo.Block(m.t)
    for t in m.t:
        m.force[t].brake = pyo.Expression(expr=positive_part(m.force[t], m.x[t] - 1))
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1 - 2 * m.force[t].brake)
    assert boundary(solved(m), 1) < 1e-9


def test_the_transformed_copy_is_solved_and_the_original_stays_smooth():
    m = braked('smooth')
    new = pyo.TransformationFactory('fesd.smooth_to_complementarity').create_using(m)
    assert boundary(solved(new, nfe=12, ncp=3), 1) < 1e-9
    assert len(m.t) == 2 and '**0.5' in str(m.ode[0].expr)


def test_a_clone_expands_by_its_own_rule():
    m = braked('function')
    clone = m.clone()
    assert boundary(solved(clone, nfe=12, ncp=3), 1) < 1e-9
    assert len(m.t) == 2 and boundary(solved(m, nfe=12, ncp=3), 1) < 1e-9


def test_a_clone_whose_rule_means_the_original_is_refused_and_left_as_it_was():
    m = state()

    @m.Block(m.t)
    def brake(b, t):
        b.ode = pyo.Constraint(expr=m.dx[t] == 1 - 2 * maximum(b, 0, m.x[t] - 1))

    clone = m.clone()
    with pytest.raises(FesdError, match='if this model is a clone'):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(clone, nfe=4, ncp=2)
    assert len(clone.t) == len(clone.brake) == len(conditions(clone)) == 2


@pytest.mark.parametrize('scheme, tolerance', [(RADAU, 3e-5), (GAUSS, 1e-7)])
def test_an_oscillator_with_two_stiffnesses(scheme, tolerance):
    """x'' = -x + |x|/2 from (1, 0): half periods pi/sqrt(1/2) and pi/sqrt(3/2) on the two sides."""
    first, slow, fast = pi / 2 / sqrt(0.5), sqrt(0.5), sqrt(1.5)
    second, end = first + pi / fast, 6.0
    m = state(end, 1.0)
    m.v = pyo.Var(m.t, initialize=0)
    m.dv = dae.DerivativeVar(m.v)
    m.v[0].fix(0)
    m.motion = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])

    @m.Block(m.t)
    def spring(b, t):
        m = b.model()
        b.law = pyo.Constraint(expr=m.dv[t] == -m.x[t] + absolute(b, m.x[t]) / 2)

    solved(m, nfe=20, ncp=3, scheme=scheme)
    assert boundary(m, first) < tolerance and boundary(m, second) < tolerance
    assert m.x[end].value == pytest.approx(sin(slow * (end - second)), abs=tolerance)


def test_a_minimum_of_a_held_control_that_jumps():
    """x' = min(u - x, 1/2) with u = 2, 1.2, 3: limited, free from t = 1.4 to the jump at 2, limited again."""
    m = state(3, points=[1, 2])
    m.u = pyo.Var(m.t, initialize=1)

    @m.Block(m.t)
    def drive(b, t):
        m = b.model()
        b.ode = pyo.Constraint(expr=m.dx[t] == minimum(b, m.u[t] - m.x[t], 0.5))

    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=24, ncp=3, piecewise_constant=[m.u])
    for t, u in ((1, 2), (2, 1.2), (3, 3)):
        m.u[t].fix(u)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    assert boundary(m, 1.4) < 1e-9
    end = 1.2 - 0.5 * exp(-0.6)
    assert [m.x[t].value for t in (1, 2, 3)] == pytest.approx([0.5, end, end + 0.5], abs=1e-8)


def test_a_valve_saturates_at_its_exact_times():
    m, results = saturating_valve.solve(nfe=60)
    times, end = saturating_valve.reference()
    assert results.solver.stationarity == 'B'
    found = saturating_valve.changes(m)
    assert [now for _, now in found] == [now for _, now in times] == ['follows', 'closed', 'follows']
    assert [t for t, _ in found] == pytest.approx([t for t, _ in times], abs=1e-6)
    assert [m.level[6].value, m.integral[6].value] == pytest.approx(list(end), abs=1e-7)
    opening = pyomo_fesd.trajectory(m)['valve.opening']
    assert opening.min() == pytest.approx(0, abs=1e-12) and opening.max() == pytest.approx(1, abs=1e-12)


def test_clip_and_its_smoothed_form_give_the_same():
    def build(way):
        m = state(4)

        @m.Block(m.t)
        def valve(b, t):
            m = b.model()
            z = 1.5 * m.x[t] - 0.5
            limited = clip(b, z, 0.25, 0.75) if way == 'clip' else smooth_min(smooth_max(z, 0.25), 0.75)
            b.ode = pyo.Constraint(expr=m.dx[t] == 1 - limited)

        if way == 'smooth':
            exact(m)
        return solved(m, nfe=32, ncp=3)

    clipped, smoothed = build('clip'), build('smooth')
    # x rises at 3/4 until 3/2 x - 1/2 = 1/4, that is x = 1/2, then x' = 3/2 (1 - x) until x = 5/6, then x' = 1/4
    first, second = 2 / 3, 2 / 3 + np.log(3) / 1.5
    for m in (clipped, smoothed):
        assert boundary(m, first) < 1e-9 and boundary(m, second) < 1e-7
        assert m.x[4].value == pytest.approx(5 / 6 + (4 - second) / 4, abs=1e-7)


def test_an_optimal_control_with_an_absolute_value_in_its_integral():
    """min int |x| + u**2/20 with u held on [0, 1] and [1, 2], x(0) = 1: u = -1, 0 and the cost 1/2 + 1/20."""
    m = state(2.0, 1.0, points=[1])
    m.u = pyo.Var(m.t, bounds=(-2, 2), initialize=0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    m.loss = pyo.Expression(m.t, rule=lambda m, t: abs(m.x[t]))
    m.total = dae.Integral(m.t, rule=lambda m, t: m.loss[t] + m.u[t] ** 2 / 20)
    m.cost = pyo.Objective(expr=m.total)
    exact(m)
    solved(m, nfe=12, ncp=2, piecewise_constant=[m.u])
    assert [pyo.value(m.cost), m.u[1].value, m.u[2].value] == pytest.approx([0.55, -1, 0], abs=1e-7)


def test_a_nonsmooth_term_inside_a_mode_after_fesd_dcs():
    """x' = 1 below 0, x' = 4/5 - max(0, x - 1/2) above, from -1: switch at 1, nonsmooth term at 1 + 5/8."""
    m = state(3.0, -1.0)
    m.side = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] <= 0, m.dx[t] == 1],
            [m.x[t] >= 0, m.dx[t] == 0.8 - smooth_max(m.x[t] - 0.5, 0)],
        ],
    )
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    exact(m)
    solved(m, nfe=24, ncp=3)
    assert [s.time for s in pyomo_fesd.switches(m)] == [pytest.approx(1, abs=1e-9)]
    assert boundary(m, 1.625) < 1e-9
    assert m.x[3].value == pytest.approx(0.5 + 0.8 * (1 - exp(-1.375)), abs=1e-8)


def test_sizes_beside_the_larger_formulations():
    """A nonsmooth term: 1 variable, 0 equations, 1 pair at a time; p - q = z one more of the first two; a Disjunction even more."""

    def split(m, t):
        return m.x[t] - 1

    function = braked('function')
    parts = state()
    parts.p, parts.q = (pyo.Var(parts.t, bounds=(0, None), initialize=0) for _ in range(2))
    parts.split = pyo.Constraint(parts.t, rule=lambda m, t: m.p[t] - m.q[t] == split(m, t))
    parts.pair = Complementarity(parts.t, rule=lambda m, t: complements(m.p[t] >= 0, m.q[t] >= 0))
    parts.ode = pyo.Constraint(parts.t, rule=lambda m, t: m.dx[t] == 1 - 2 * m.p[t])
    modes = state()
    modes.brake = Disjunction(
        modes.t,
        rule=lambda m, t: [[split(m, t) <= 0, m.dx[t] == 1], [split(m, t) >= 0, m.dx[t] == 1 - 2 * split(m, t)]],
    )
    pyo.TransformationFactory('fesd.dcs').apply_to(modes)
    sizes = []
    for m in (function, parts, modes):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=10, ncp=3)
        report = pyomo_fesd.report(m)
        sizes.append([report[name] for name in ('variables', 'constraints', 'pairs')])
    points = 1 + 10 * 3
    assert np.subtract(sizes[1], sizes[0]).tolist() == [points, 0, 0]  # the row s - z >= 0 becomes the row p - q = z
    assert np.subtract(sizes[2], sizes[0]).tolist() == [2 * points, 0, 11]


# Continuity


def watched(m, caplog, **keywords):
    """Whether a warning about continuity appears."""
    with caplog.at_level(logging.WARNING, 'pyomo_fesd'):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=4, ncp=2, **keywords)
    return 'continuous in time' in caplog.text


@pytest.mark.parametrize('way', ['function', 'transformation'])
def test_nested_nonsmooth_terms_of_what_equations_tie_to_states_are_continuous(way, caplog):
    m = state()
    m.a, m.b = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
    m.one = pyo.Constraint(m.t, rule=lambda m, t: m.a[t] + m.b[t] == 3 * m.x[t])
    m.two = pyo.Constraint(m.t, rule=lambda m, t: m.a[t] - m.b[t] == m.x[t])
    if way == 'function':

        @m.Block(m.t)
        def law(k, t):
            m = k.model()
            k.ode = pyo.Constraint(expr=m.dx[t] == 1 - minimum(k, maximum(k, m.a[t] - 1, 0, m.b[t] - 0.2), 0.5))
    else:
        m.law = pyo.Constraint(
            m.t, rule=lambda m, t: m.dx[t] == 1 - smooth_min(smooth_max(smooth_max(m.a[t] - 1, 0), m.b[t] - 0.2), 0.5)
        )
        assert exact(m).pairs == 6
    assert not watched(m, caplog)


def test_what_follows_from_a_nonsmooth_term_by_equations_is_continuous_too(caplog):
    m = state()
    m.a = pyo.Var(m.t, initialize=0)
    m.level = pyo.Constraint(m.t, rule=lambda m, t: m.a[t] == 2 * abs(m.x[t] - 1))
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1 - 0.1 * abs(m.a[t] - 1))
    exact(m)
    assert not watched(m, caplog)


def test_a_nonsmooth_term_of_a_free_algebraic_variable_is_warned_about_unless_the_user_tells(caplog):
    def build():
        m = state()
        m.u = pyo.Var(m.t, initialize=0, bounds=(-1, 1))
        m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1 - abs(m.u[t]))
        exact(m)
        return m

    m = build()
    assert not watched(m, caplog, continuous=[m.u])
    assert watched(build(), caplog) and 'ode.complementarity[1]' in caplog.text


def test_one_jumping_argument_does_not_spoil_the_other_indices(caplog):
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, 2)), pyo.RangeSet(2)
    m.x = pyo.Var(m.t, m.i, initialize=0)
    m.u = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.ode = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dx[t, i] == 1 - abs(m.x[t, i] - (m.u[t] if i == 2 else 1)))
    exact(m)
    watched(m, caplog)
    assert 'ode.complementarity[2,1]' in caplog.text and 'ode.complementarity[1,1]' not in caplog.text
