"""A weir on a vessel that is dumped every 2.5: V' = 1 - F, 0 <= F perp 1 - h >= 0 with the level h = V/2; V+ = V/2 - 1/4.

From V = 1: full (2) at t = 1, overflows (F = 1) until it is dumped to 0.75 at 2.5; full at 3.75, dumped at 5, 1.75 at 6.  h follows
from V by an equation, so it jumps with V: the weir is shut right after each dump.
"""

import pyomo.environ as pyo
from problems.states import over_time
from pyomo.mpec import Complementarity, complements

import pyomo_fesd

FULL, DUMPS, END, FINAL = (1.0, 3.75), (2.5, 5.0), 6.0, 1.75


def build(level='algebraic'):
    m = over_time(END, V=1, c=2.5)
    m.F = pyo.Var(m.t, initialize=0, bounds=(0, None))
    m.h = pyo.Var(m.t, initialize=0.5)
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dV[t] == 1 - m.F[t])
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dc[t] == -1)
    m.cylinder = pyo.Constraint(m.t, rule=lambda m, t: m.h[t] == m.V[t] / 2)

    def overflow(m, t):
        return complements(m.F[t] >= 0, 1 - (m.h[t] if level == 'algebraic' else m.V[t] / 2) >= 0)

    m.weir = Complementarity(m.t, rule=overflow)
    m.dump = pyomo_fesd.state_jump(
        m.t, guard=lambda m, t: m.c[t], reset=lambda m, t: [(m.V[t], m.V[t] / 2 - 0.25), (m.c[t], m.c[t] + 2.5)]
    )
    return m
