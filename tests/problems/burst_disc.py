"""A vessel with a burst disc: the pressure rises at rate 2 until the disc bursts at p = 5; it never closes again, and p' = -p.

From p = 1 it bursts at t = 2; then p = 5 exp(-(t - 2)).
"""

from math import exp

import pyomo.environ as pyo
from problems.states import over_time

SWITCH, END = 2.0, 4.0
FINAL = 5 * exp(-(END - SWITCH))


def build():
    m = over_time(END, p=1)

    @m.Disjunct(m.t)
    def closed(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.p[t] <= 5)
        d.ode = pyo.Constraint(expr=m.dp[t] == 2)

    @m.Disjunct(m.t)
    def burst(d, t):
        m = d.model()
        d.ode = pyo.Constraint(expr=m.dp[t] == -m.p[t])

    @m.Disjunction(m.t)
    def disc(m, t):
        return [m.closed[t], m.burst[t]]

    m.closed[0].indicator_var.fix(True)
    return m
