"""Three gears with hysteresis, up and down again: v' = p, 2 p, p/2 in gear 1, 2, 3 with the pedal p = 1 until t = 5, then p = -1.

Up at v = 2 and at v = 5, down at v = 4 and at v = 1.  From v = 0 in the first gear: v = 2 at t = 2, 5 at 3.5, 5.75 at 5; back to 4
at 8.5, to 1 at 10, to 0 at 11.
"""

import pyomo.environ as pyo
from problems.states import over_time
from pyomo.gdp import Disjunct, Disjunction

SWITCHES = [(2.0, 'first', 'second'), (3.5, 'second', 'third'), (8.5, 'third', 'second'), (10.0, 'second', 'first')]
PEDAL, END, FINAL = 5.0, 11.0, 0.0
#: name, rate, least and largest v
GEARS = (('first', 1, None, 2), ('second', 2, 1, 5), ('third', 0.5, 4, None))


def build(order=('first', 'second', 'third'), given='first'):
    """The gears in this ``order`` in the Disjunction, one of them ``given`` at the first time."""
    m = over_time(END, v=0, c=0)
    m.p = pyo.Var(m.t, initialize=1)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dc[t] == 1)
    m.pedal = Disjunction(m.t, rule=lambda m, t: [[m.c[t] <= PEDAL, m.p[t] == 1], [m.c[t] >= PEDAL, m.p[t] == -1]])
    for name, rate, low, high in GEARS:
        m.add_component(name, Disjunct(m.t, rule=_gear(rate, low, high)))
    m.gear = Disjunction(m.t, rule=lambda m, t: [m.component(name)[t] for name in order])
    if given is not None:
        m.component(given)[0].indicator_var.fix(True)
    return m


def _gear(rate, low, high):
    def rule(d, t):
        m = d.model()
        if low is not None:
            d.down = pyo.Constraint(expr=m.v[t] >= low)
        if high is not None:
            d.up = pyo.Constraint(expr=m.v[t] <= high)
        d.ode = pyo.Constraint(expr=m.dv[t] == rate * m.p[t])

    return rule
