"""A control that may turn back a state where it touches a surface: dx/dt = u on [0, 1] and -1 on [1, 2], x(0) = -1.

Above x = 0 a reward of 10 is earned.  With u = 1 the surface is touched at t = 1; to both sides of it the cost falls with u, as the
state is above for 1 - 1/u and then for u - 1, up to 1.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

TOUCHING = 1.0


def cost(u):
    """The exact cost of a control."""
    above = 1 - 1 / u + min(u - 1, 1) if u > 1 else 0.0
    return (u - 1.5) ** 2 - 10 * above


def build():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x, m.y = pyo.Var(m.t, initialize=-1), pyo.Var(m.t)
    m.u = pyo.Var(m.t, initialize=lambda m, t: 1 if t <= 1 else -1)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.x[0].fix(-1)
    m.y[0].fix(0)
    m.u[2].fix(-1)
    m.rate = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dy[t] == 0], [m.x[t] >= 0, m.dy[t] == -10]])
    m.cost = pyo.Objective(expr=m.y[2] + (m.u[1] - 1.5) ** 2)
    return m
