"""Two control stages, the control held on each: dx/dt = 3 u below zero and u above, x(0) = -4.5, x(2) = 0.3, 0 <= u <= 1.2.

x cannot reach zero on the first stage.  With a and b the control on [0, 1] and [1, 2] and zero reached at t = 1 + tau,
    3 a + 3 b tau = 4.5,   b (1 - tau) = 0.3,   hence a + b = 1.8;
4 a^2 + 5 b^2 is smallest for a = 1, b = 0.8: zero is reached at t = 1.625.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

CONTROLS, SWITCH, VALUE = (1.0, 0.8), 1.625, 7.2


def build():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x = pyo.Var(m.t, initialize=-4.5)
    m.u = pyo.Var(m.t, initialize=1, bounds=(0, 1.2))
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-4.5)
    m.zero = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3 * m.u[t]], [m.x[t] >= 0, m.dx[t] == m.u[t]]])
    m.end = pyo.Constraint(expr=m.x[2] == 0.3)
    m.cost = pyo.Objective(expr=4 * m.u[1] ** 2 + 5 * m.u[2] ** 2)
    return m
