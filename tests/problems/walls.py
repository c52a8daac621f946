"""A state between two walls: dx/dt = f + p - n with x in [0, 1] and f = 1, then -1 from t = 1 on; x(0) = 1/2, 0 <= t <= 3.

The multiplier of the walls is the mixed complementarity  0 <= x <= 1  perp  dx/dt - f.  x reaches 1 at t = 1/2, leaves when f turns
at t = 1, and rests at 0 from t = 2 on.  f is a held input of three control stages, so that the wall is left on a boundary of them.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements

SWITCHES = ((0.5, 'between', 'at upper bound'), (1.0, 'at upper bound', 'between'), (2.0, 'between', 'at lower bound'))
INPUT = {1: 1.0, 2: -1.0, 3: -1.0}


def exact(t):
    """x at time ``t``."""
    return min(0.5 + t, 1.0) if t <= 1 else max(2.0 - t, 0.0)


def build(measured=False):
    """With ``measured`` the walls limit an algebraic variable y = 2 x + 1 in [1, 3]."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2, 3])
    m.x = pyo.Var(m.t, initialize=0.5)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0.5)
    m.f = pyo.Var(m.t, initialize=INPUT)
    for t, value in INPUT.items():
        m.f[t].fix(value)
    if measured:
        m.y = pyo.Var(m.t, initialize=2)
        m.scale = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == 2 * m.x[t] + 1)
    limited = (lambda m, t: pyo.inequality(1, m.y[t], 3)) if measured else (lambda m, t: pyo.inequality(0, m.x[t], 1))
    m.walls = Complementarity(m.t, rule=lambda m, t: complements(limited(m, t), m.dx[t] - m.f[t]))
    return m
