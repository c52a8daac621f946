"""A set-point u that differs between two control stages: dx/dt = 1, x(0) = 0, u = 2 on [0, 1] and U on [1, 2].

x reaches the set-point at max(U, 1), perhaps just after the stage boundary.  Then dy/dt is
1 (``mode``) or x - u (``kink``).
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction


def exact(U, kind):
    """y(2)."""
    reached = max(U, 1)
    return 2 - reached if kind == 'mode' else ((2 - U) ** 2 - (reached - U) ** 2) / 2


def build(U, kind):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x, m.y = pyo.Var(m.t, initialize=0, bounds=(-9, 9)), pyo.Var(m.t, initialize=0)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.x[0].fix(0)
    m.y[0].fix(0)
    m.u = pyo.Var(m.t, initialize=lambda m, t: 2 if t <= 1 else U)
    m.u[1].fix(2)
    m.u[2].fix(U)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1)
    if kind == 'mode':
        m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= m.u[t], m.dy[t] == 0], [m.x[t] >= m.u[t], m.dy[t] == 1]])
        return m
    m.w, m.f = pyo.Var(m.t, initialize=0, bounds=(-9, 9)), pyo.Var(m.t, initialize=0)
    m.error = pyo.Constraint(m.t, rule=lambda m, t: m.w[t] == m.x[t] - m.u[t])
    m.table = pyo.Piecewise(
        m.t, m.f, m.w, pw_pts=[-9, 0, 9], f_rule=[0, 0, 9], pw_constr_type='EQ', pw_repn='SOS2', warn_domain_coverage=False
    )
    m.follows = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.f[t])
    return m
