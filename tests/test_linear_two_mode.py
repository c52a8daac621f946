"""A linear two-mode system with random data agrees with its closed-form solution, whether it crosses or slides."""

from math import exp, log

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pyomo_fesd

T = 2.0


def build(x0, k, r):
    """dx/dt = k[0] (r[0] - x) below zero, k[1] (r[1] - x) above."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, T))
    m.x = pyo.Var(m.t, initialize=x0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(x0)

    @m.Disjunction(m.t)
    def side(m, t):
        below, above = (m.dx[t] == k[i] * (r[i] - m.x[t]) for i in (0, 1))
        return [[m.x[t] <= 0, below], [m.x[t] >= 0, above]]

    return m


def exact(x0, k, r):
    """Switch time, or None, and x(T)."""
    t_s = log((r[0] - x0) / r[0]) / k[0]
    if t_s >= T:
        return None, r[0] + (x0 - r[0]) * exp(-k[0] * T)
    return t_s, max(0.0, r[1] * (1 - exp(-k[1] * (T - t_s))))


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    x0=st.floats(-2, -0.3),
    k=st.tuples(st.floats(0.3, 2), st.floats(0.3, 2)),
    up=st.floats(0.5, 2),
    after=st.floats(0.3, 2),
    slides=st.booleans(),
)
def test_random_linear_two_mode_systems_agree_with_their_exact_solution(x0, k, up, after, slides):
    r = (up, -after if slides else after)
    t_s, end = exact(x0, k, r)
    # a switch nearer to an end than the least element length is not on this grid
    assume(t_s is None or 0.2 < t_s < T - 0.2)
    m = build(x0, k, r)
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=12, ncp=3)
    assert pyo.check_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
    # the error of the scheme: order 5, elements up to 0.3 long, rates up to 2
    assert m.x[T].value == pytest.approx(end, abs=1e-4)
    found = pyomo_fesd.switches(m)
    assert len(found) == (t_s is not None)
    if found:
        assert found[0].time == pytest.approx(t_s, abs=1e-4)
        assert found[0].after == ('sliding mode 1 | mode 2' if slides else 'mode 2')
