"""Crossing: dx/dt = 2 below zero and 0.2 above, x(0) = -1, 0 <= t <= 1.5."""

from problems.states import over_time
from pyomo.gdp import Disjunction

SWITCH, FINAL = 0.5, 0.2


def build():
    m = over_time(1.5, x=-1)
    m.zero = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 2], [m.x[t] >= 0, m.dx[t] == 0.2]])
    return m
