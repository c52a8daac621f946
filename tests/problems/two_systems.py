"""Two independent Disjunctions: ``signum`` with its switch at 2/3, and dy/dt = -sgn y, y(0) = 1/2, which slides from t = 1/2 on."""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

SWITCHES = ((0.5, 'friction'), (2 / 3, 'sgn'))
FINAL_X, FINAL_Y = 4 / 3, 0.0


def build():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=-2)
    m.y = pyo.Var(m.t, initialize=0.5)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.x[0].fix(-2)
    m.y[0].fix(0.5)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3], [m.x[t] >= 0, m.dx[t] == 1]])
    m.friction = Disjunction(m.t, rule=lambda m, t: [[m.y[t] <= 0, m.dy[t] == 1], [m.y[t] >= 0, m.dy[t] == -1]])
    return m
