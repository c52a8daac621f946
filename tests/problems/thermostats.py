"""Several thermostats as in examples/thermostat.py, which begin at different temperatures: an indexed Disjunction.

``FIRST`` are the times at which each heater goes off first.
"""

from math import log

import pyomo.dae as dae
import pyomo.environ as pyo
from thermostat import COOLS, HEATS, HIGH, LOW

START = {'a': 15.0, 'b': 17.0, 'c': 19.5}
FIRST = {i: 5 * log((50 - y) / 30) for i, y in START.items()}


def switching_times(i, end):
    """When heater ``i`` is switched, up to ``end``."""
    times, stretches = [FIRST[i]], [COOLS, HEATS]
    while times[-1] + stretches[(len(times) - 1) % 2] < end:
        times.append(times[-1] + stretches[(len(times) - 1) % 2])
    return times


def build(end=1.5, time_first=False):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    m.i = pyo.Set(initialize=list(START))
    m.y = pyo.Var(m.i, m.t, initialize=lambda m, i, t: START[i])
    m.dy = dae.DerivativeVar(m.y, wrt=m.t)
    for i in m.i:
        m.y[i, 0].fix(START[i])
    sets = (m.t, m.i) if time_first else (m.i, m.t)

    def split(index):
        return index if not time_first else index[::-1]

    @m.Disjunct(*sets)
    def heating(d, *index):
        m, (i, t) = d.model(), split(index)
        d.until = pyo.Constraint(expr=m.y[i, t] <= HIGH)
        d.ode = pyo.Constraint(expr=m.dy[i, t] == 10 - m.y[i, t] / 5)

    @m.Disjunct(*sets)
    def cooling(d, *index):
        m, (i, t) = d.model(), split(index)
        d.until = pyo.Constraint(expr=m.y[i, t] >= LOW)
        d.ode = pyo.Constraint(expr=m.dy[i, t] == -m.y[i, t] / 5)

    @m.Disjunction(*sets)
    def relay(m, *index):
        return [m.heating[index], m.cooling[index]]

    for i in m.i:
        m.heating[(0, i) if time_first else (i, 0)].indicator_var.fix(True)
    return m


def build_in_blocks(end=1.5):
    """One thermostat, its modes in Blocks over time."""
    from problems.states import over_time
    from pyomo.gdp import Disjunct, Disjunction

    m = over_time(end, y=START['a'])

    @m.Block(m.t)
    def hyb(b, t):
        m = b.model()
        b.heating, b.cooling = Disjunct(), Disjunct()
        b.heating.until = pyo.Constraint(expr=m.y[t] <= HIGH)
        b.heating.ode = pyo.Constraint(expr=m.dy[t] == 10 - m.y[t] / 5)
        b.cooling.until = pyo.Constraint(expr=m.y[t] >= LOW)
        b.cooling.ode = pyo.Constraint(expr=m.dy[t] == -m.y[t] / 5)
        b.relay = Disjunction(expr=[b.heating, b.cooling])

    m.hyb[0].heating.indicator_var.fix(True)
    return m
