"""Right-hand sides that depend on time, written with a clock state: dc/dt = 1, c(0) = 0.

dx/dt = 2 c below zero and 3 c^2 above, x(0) = -1, 0 <= t <= 2: x = t^2 - 1 up to t = 1, then t^3 - 1, x(2) = 7.
"""

import pyomo.environ as pyo
from problems.states import over_time
from pyomo.gdp import Disjunction

SWITCH, FINAL = 1.0, 7.0


def build():
    m = over_time(2, c=0, x=-1)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dc[t] == 1)
    m.zero = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 2 * m.c[t]], [m.x[t] >= 0, m.dx[t] == 3 * m.c[t] ** 2]])
    return m
