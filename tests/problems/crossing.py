"""Crossing: dx/dt = 2 below zero and 0.2 above, x(0) = -1, 0 <= t <= 1.5."""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

SWITCH, FINAL = 0.5, 0.2


def build():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1.5))
    m.x = pyo.Var(m.t, initialize=-1)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-1)
    m.zero = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 2], [m.x[t] >= 0, m.dx[t] == 0.2]])
    return m
