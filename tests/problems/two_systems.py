"""Two independent Disjunctions: ``signum`` with its switch at 2/3, and dy/dt = -sgn y, y(0) = 1/2, which slides from t = 1/2 on."""

from problems.states import over_time
from pyomo.gdp import Disjunction

SWITCHES = ((0.5, 'friction'), (2 / 3, 'sgn'))
FINAL_X, FINAL_Y = 4 / 3, 0.0


def build():
    m = over_time(2, x=-2, y=0.5)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3], [m.x[t] >= 0, m.dx[t] == 1]])
    m.friction = Disjunction(m.t, rule=lambda m, t: [[m.y[t] <= 0, m.dy[t] == 1], [m.y[t] >= 0, m.dy[t] == -1]])
    return m
