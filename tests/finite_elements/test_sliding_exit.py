"""Slides that are left without a kink: the switching time is that of the multiplier, and the order is kept."""

from math import exp, log

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd.finite_elements.sliding_exit import derivative_at_zero, value_at_one
from tests.problems.running import LEGENDRE, RADAU, move, solve, transform

LEAVES, END = log(2), 2.0


def relay(**keywords):
    """dx = exp(s) - 1 - sgn x from 0: slides while exp(s) - 1 < 1, until s = log 2; then x = exp(s) - 2 s - 2 + 2 log 2."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, END))
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    s = pyomo_fesd.clock(m)
    m.sgn = Disjunction(
        m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == pyo.exp(s[t])], [m.x[t] >= 0, m.dx[t] == pyo.exp(s[t]) - 2]]
    )
    pyo.TransformationFactory('fesd.dcs').apply_to(m, **keywords)
    return m


def errors(m):
    """Of the time at which it leaves, and of the state at the end."""
    (switch,) = pyomo_fesd.switches(m)
    return abs(switch.time - LEAVES), abs(m.x[END].value - (exp(END) - 2 * END - 2 + 2 * LEAVES))


@pytest.mark.parametrize('form', ['auto', 'stewart', 'heaviside'])
def test_radau_finds_the_time_at_which_the_multiplier_arrives(form):
    time, state = errors(solve(move(relay(form=form), 10, 3)))
    assert time < 1e-10 and state < 1e-7


@pytest.mark.parametrize('scheme, order', [(RADAU, 5), (LEGENDRE, 6)])
def test_the_order_is_kept(scheme, order):
    found = [errors(solve(move(relay(), N, 3, scheme=scheme)))[1] for N in (5, 20)]
    assert np.log(found[0] / found[1]) / log(4) > order - 0.7


def test_without_equilibration_the_boundary_is_free():
    # a simulation would find it
    time, _ = errors(solve(move(relay(), 10, 3, equilibration='none'), simulate_first=False))
    assert time > 1e-4


def test_an_overflow_that_ebbs_away():
    """dV = 1 - s - F with 0 <= 1 - V perp F >= 0 from V = 1: F = 1 - s ends at s = 1, then V = 1 - (s - 1)**2/2."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.V = pyo.Var(m.t, initialize=1)
    m.F = pyo.Var(m.t, initialize=0, bounds=(0, None))
    m.dV = dae.DerivativeVar(m.V)
    m.V[0].fix(1)
    s = pyomo_fesd.clock(m)
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dV[t] == 1 - s[t] - m.F[t])
    m.weir = Complementarity(m.t, rule=lambda m, t: complements(1 - m.V[t] >= 0, m.F[t] >= 0))
    solve(move(m, 7, 2))
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(1, abs=1e-10)
    assert m.V[2].value == pytest.approx(0.5, abs=1e-10)


def test_an_exit_that_another_switch_enforces_keeps_its_time():
    """x slides with nu = 1/2 until another mode turns both rates up at z = 1: nu does not arrive at its end."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x, m.z = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
    m.lift = pyo.Var(m.t, initialize=0)
    m.dx, m.dz = dae.DerivativeVar(m.x), dae.DerivativeVar(m.z)
    m.x[0].fix(0)
    m.z[0].fix(0)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dz[t] == 1.3)
    m.turn = Disjunction(m.t, rule=lambda m, t: [[m.z[t] <= 1, m.lift[t] == 0], [m.z[t] >= 1, m.lift[t] == 3]])
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 1 + m.lift[t]], [m.x[t] >= 0, m.dx[t] == m.lift[t] - 1]])
    solve(transform(m, 9, 2))
    assert {round(s.time * 1.3, 9) for s in pyomo_fesd.switches(m)} == {1.0}
    assert m.x[2].value == pytest.approx(2 * (2 - 1 / 1.3), abs=1e-9)


@pytest.mark.parametrize('tau', [(1 / 3, 1.0), (0.155051, 0.644949, 1.0), (0.211325, 0.788675)])
def test_the_weights_are_exact_for_polynomials(tau):
    nodes, p = np.array([0.0, *tau]), np.polynomial.Polynomial([0.3, -1.2, 0.7][: len(tau) + 1])
    assert np.dot(derivative_at_zero(tau), p(nodes)) == pytest.approx(p.deriv()(0))
    q = np.polynomial.Polynomial([0.3, -1.2, 0.7][: len(tau)])
    assert np.dot(value_at_one(tau), q(np.array(tau))) == pytest.approx(q(1))


def test_one_stage_has_no_slope_to_tell():
    m = move(relay(), 4, 1)
    assert m.component('_pyomo_fesd_elements_t').component('exit') is None
