"""Two states that are complementary themselves: dx/dt - dy/dt = 1, 0 <= x perp y >= 0, x(0) = 0, y(0) = 1, 0 <= t <= 2.

y falls to zero at t = 1, then x rises to x(2) = 1.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements

SWITCH, FINAL = 1.0, 1.0


def build():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=0)
    m.y = pyo.Var(m.t, initialize=1)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.x[0].fix(0)
    m.y[0].fix(1)
    m.exchange = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] - m.dy[t] == 1)
    m.either = Complementarity(m.t, rule=lambda m, t: complements(m.x[t] >= 0, m.y[t] >= 0))
    return m
