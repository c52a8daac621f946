"""A threshold w that is a control, held on each of three stages: dx/dt = 2 below w and 1 above, x(0) = 0, w = 1/2, 3, -1.

x = 1/2 at t = 1/4, 5/4 at 1; below the next threshold, 3 at 15/8, 25/8 at 2; above the last one, 33/8 at 3.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

THRESHOLDS = {1: 0.5, 2: 3.0, 3: -1.0}
SWITCHES = [(0.25, 'mode 1', 'mode 2'), (1.0, 'mode 2', 'mode 1'), (1.875, 'mode 1', 'mode 2')]
FINAL = 33 / 8


def threshold(t):
    """w at time t; a boundary belongs to the stage on its left."""
    return next(w for end, w in THRESHOLDS.items() if t <= end)


def build():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, *THRESHOLDS])
    m.x, m.w = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=lambda m, t: threshold(t))
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.side = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= m.w[t], m.dx[t] == 2], [m.x[t] >= m.w[t], m.dx[t] == 1]])
    return m
