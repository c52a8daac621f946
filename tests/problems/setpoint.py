"""A set point that jumps from one control stage to the next: dx/dt = 1 below u and -2 above, x(0) = 0.

u = 5 on [0, 1] and -5 on [1, 2]: x(1) = 1, and there the mode changes although x is far from either set point; x(2) = -1.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

SWITCH, MIDDLE, FINAL = 1.0, 1.0, -1.0
SETPOINTS = (5.0, -5.0)


def build(handed_on=False):
    """With ``handed_on`` the regulator sees a variable that an equation ties to u."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x = pyo.Var(m.t, initialize=0)
    m.u = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.first = pyo.Constraint(expr=m.u[1] == SETPOINTS[0])
    m.second = pyo.Constraint(expr=m.u[2] == SETPOINTS[1])
    seen = m.u
    if handed_on:
        seen = m.r = pyo.Var(m.t, initialize=0)
        m.signal = pyo.Constraint(m.t, rule=lambda m, t: m.r[t] == m.u[t])
    m.regulator = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= seen[t], m.dx[t] == 1], [m.x[t] >= seen[t], m.dx[t] == -2]])
    return m


def build_given():
    """The same with the set point as a mutable Param; ``fesd.dcs`` looks at the first time too."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x = pyo.Var(m.t, initialize=0)
    m.p = pyo.Param(m.t, mutable=True, initialize=dict(zip((0, 1, 2), (SETPOINTS[0], *SETPOINTS))))
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.regulator = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= m.p[t], m.dx[t] == 1], [m.x[t] >= m.p[t], m.dx[t] == -2]])
    return m
