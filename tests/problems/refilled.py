"""A heated vessel with hysteresis that is refilled: x rises at rate 1 up to 4, falls at rate 1.5 to 1; every 3.5 it jumps by -2.

From x = 0 rising: 3.5 at t = 3.5, refilled to 1.5, 4 at 6 (turns), 2.5 at 7, refilled to 0.5.  That is outside the region of
'falling', which ends there although its condition was not zero; rising to 3.9 at 10.4.
"""

import pyomo.environ as pyo
from problems.states import over_time

import pyomo_fesd

END, FINAL = 10.4, 3.9
REFILLS = (3.5, 7.0)
SWITCHES = [(6.0, 'rising', 'falling'), (7.0, 'falling', 'rising')]


def build():
    """c counts down to the next refill."""
    m = over_time(END, x=0, c=3.5)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dc[t] == -1)

    @m.Disjunct(m.t)
    def rising(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.x[t] <= 4)
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunct(m.t)
    def falling(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.x[t] >= 1)
        d.ode = pyo.Constraint(expr=m.dx[t] == -1.5)

    @m.Disjunction(m.t)
    def relay(m, t):
        return [m.rising[t], m.falling[t]]

    m.rising[0].indicator_var.fix(True)
    m.refill = pyomo_fesd.state_jump(
        m.t,
        guard=lambda m, t: m.c[t],
        reset=lambda m, t: [(m.x[t], m.x[t] - 2), (m.c[t], m.c[t] + 3.5)],
    )
    return m
