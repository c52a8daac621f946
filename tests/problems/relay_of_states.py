"""Two states that are complementary themselves: dx/dt - dy/dt = 1, 0 <= x perp y >= 0, x(0) = 0, y(0) = 1, 0 <= t <= 2.

y falls to zero at t = 1, then x rises to x(2) = 1.
"""

import pyomo.environ as pyo
from problems.states import over_time
from pyomo.mpec import Complementarity, complements

SWITCH, FINAL = 1.0, 1.0


def build():
    m = over_time(2, x=0, y=1)
    m.exchange = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] - m.dy[t] == 1)
    m.either = Complementarity(m.t, rule=lambda m, t: complements(m.x[t] >= 0, m.y[t] >= 0))
    return m
