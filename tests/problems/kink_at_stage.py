"""A kink of a table at the boundary of two control stages: dx/dt = u, x(0) = -1, x(2) = 1, min of the integral of u^2 g(x).

u is held on [0, 1] and on [1, 2]; g = 1 + A max(0, x) is a table with a kink at x = 0.  With u_1 = u and u_2 = 2 - u,

    F(u) = u P(-1, u - 1) + (2 - u) P(u - 1, 1),     P(a, b) = b - a + A (max(b, 0)^2 - max(a, 0)^2)/2

which is smooth at u = 1, where the kink is reached at t = 1: its slope there is -A/2.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from scipy.optimize import minimize_scalar


def fuel(u, A):
    """F(u)."""

    def P(a, b):
        return b - a + A * (max(b, 0) ** 2 - max(a, 0) ** 2) / 2

    return u * P(-1, u - 1) + (2 - u) * P(u - 1, 1)


def best(A):
    """The best u and its fuel."""
    found = minimize_scalar(fuel, bounds=(0.1, 1.9), args=(A,), method='bounded', options={'xatol': 1e-10})
    return found.x, found.fun


def build(A, start=1.0):
    """With u at ``start`` on both stages."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x = pyo.Var(m.t, bounds=(-3, 3), initialize=lambda m, t: t - 1)
    m.u, m.g, m.F = pyo.Var(m.t, bounds=(-1, 4), initialize=start), pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=0)
    m.dx, m.dF = dae.DerivativeVar(m.x), dae.DerivativeVar(m.F)
    m.x[0].fix(-1)
    m.F[0].fix(0)
    m.motion = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    m.burnt = pyo.Constraint(m.t, rule=lambda m, t: m.dF[t] == m.u[t] ** 2 * m.g[t])
    m.table = pyo.Piecewise(
        m.t, m.g, m.x, pw_pts=[-3, 0, 3], f_rule=[1, 1, 1 + 3 * A], pw_constr_type='EQ', pw_repn='SOS2', warn_domain_coverage=False
    )
    m.end = pyo.Constraint(expr=m.x[2] == 1)
    m.fuel = pyo.Objective(expr=m.F[2])
    return m
