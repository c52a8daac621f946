"""Weir: a tank fed by 1 flows over when it is full, as the user's own Complementarity over time.

dV/dt = 1 - F,   0 <= Vmax - V  perp  F >= 0,   V(0) = 0,   0 <= t <= 2:   full at t = Vmax = 0.7, then F = 1.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements

SWITCH = V_MAX = 0.7
OVERFLOW = 1.0  # after the switch


def build(level='state', slack_first=True, first_time=True):
    """The slack is that of the state V (``level='state'``) or of an algebraic variable h = 2 V.

    h has an equation of its own ('algebraic'), or two equations tie it to another algebraic variable ('coupled').
    Without ``first_time`` the condition begins after t = 0.
    """
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.V = pyo.Var(m.t, initialize=0)
    m.F = pyo.Var(m.t, initialize=0, bounds=(0, None))
    m.dV = dae.DerivativeVar(m.V)
    m.V[0].fix(0)
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dV[t] == 1 - m.F[t])
    if level != 'state':
        m.h = pyo.Var(m.t, initialize=0)
    if level == 'algebraic':
        m.cylinder = pyo.Constraint(m.t, rule=lambda m, t: m.h[t] == 2 * m.V[t])
    if level == 'coupled':
        m.foam = pyo.Var(m.t, initialize=0)
        m.sum = pyo.Constraint(m.t, rule=lambda m, t: m.h[t] + m.foam[t] == 3 * m.V[t])
        m.difference = pyo.Constraint(m.t, rule=lambda m, t: m.h[t] - m.foam[t] == m.V[t])

    @m.Complementarity(m.t)
    def overflow(m, t):
        if t == 0 and not first_time:
            return Complementarity.Skip
        slack = (V_MAX - m.V[t] if level == 'state' else 2 * V_MAX - m.h[t]) >= 0
        return complements(slack, m.F[t] >= 0) if slack_first else complements(m.F[t] >= 0, slack)

    return m


def build_series():
    """Two weirs, the second (Vmax 0.5) fed by the first: full at 0.7 and 1.2; one Complementarity over (time, tank)."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.i = pyo.RangeSet(2)
    m.V = pyo.Var(m.t, m.i, initialize=0)
    m.F = pyo.Var(m.t, m.i, initialize=0, bounds=(0, None))
    m.dV = dae.DerivativeVar(m.V, wrt=m.t)
    for i in m.i:
        m.V[0, i].fix(0)
    feed = {1: lambda t: 1, 2: lambda t: m.F[t, 1]}
    m.balance = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dV[t, i] == feed[i](t) - m.F[t, i])
    full = {1: V_MAX, 2: 0.5}

    @m.Complementarity(m.t, m.i)
    def overflow(m, t, i):
        return complements(full[i] - m.V[t, i] >= 0, m.F[t, i] >= 0)

    return m


SWITCHES = (0.7, 1.2)  # of the series
