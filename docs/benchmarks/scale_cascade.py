"""A cascade of tanks, each of which overflows into the next: as many switching subsystems as wanted, with an exact answer.

    dx_k/dt = feed_k + q_{k-1} - LOSS x_k - q_k,      q_k = 0 where x_k < 1,   q_k = WEIR where x_k > 1

A full tank stays on its weir (a slide), which lets through what is too much.  The first tank of each group starts below its weir
and is full after a while; the others start full.
"""

from math import exp, log

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunct, Disjunction

HORIZON, LOSS, WEIR = 10.0, 0.01, 4.0
#: Too much that the first tank gets, and all the others together.
FIRST, TOGETHER = 1.0, 1.0
GROUPS, DEFICIT = 4, 2.0


def heads(S):
    """The first tank of each group."""
    groups = min(S, GROUPS)
    return [round(k * S / groups) for k in range(groups)]


def build(S):
    """The model of S tanks."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, HORIZON))
    m.tank = pyo.RangeSet(0, S - 1)
    m.x = pyo.Var(m.tank, m.t, initialize=1.0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.q = pyo.Var(m.tank, m.t, initialize=0.0)
    for k in m.tank:
        m.x[k, 0].fix(1.0 - (DEFICIT if k in heads(S) else 0.0))

    @m.Constraint(m.tank, m.t)
    def balance(m, k, t):
        above = m.q[k - 1, t] if k else 0.0
        return m.dx[k, t] == _surplus(k, S) + LOSS + above - LOSS * m.x[k, t] - m.q[k, t]

    @m.Disjunct(m.tank, m.t)
    def low(d, k, t):
        d.region = pyo.Constraint(expr=d.model().x[k, t] <= 1)
        d.flow = pyo.Constraint(expr=d.model().q[k, t] == 0)

    @m.Disjunct(m.tank, m.t)
    def full(d, k, t):
        d.region = pyo.Constraint(expr=d.model().x[k, t] >= 1)
        d.flow = pyo.Constraint(expr=d.model().q[k, t] == WEIR)

    m.weir = Disjunction(m.tank, m.t, rule=lambda m, k, t: [m.low[k, t], m.full[k, t]])
    return m


def _surplus(k, S):
    return FIRST if k == 0 else TOGETHER / S


def exact(S):
    """Times at which the heads get full, in their order."""
    level, times, now = dict.fromkeys(heads(S), 1.0 - DEFICIT), [], 0.0
    while level:
        # x = in/LOSS + (x_0 - in/LOSS) exp(-LOSS t)
        ends = {k: LOSS + sum(_surplus(j, S) for j in range(_above(k, level), k + 1)) for k in level}
        ends = {k: inflow / LOSS for k, inflow in ends.items()}
        k = min(level, key=lambda k: _time(level[k], ends[k]))
        step = _time(level[k], ends[k])
        now += step
        times.append(now)
        level = {j: ends[j] + (x - ends[j]) * exp(-LOSS * step) for j, x in level.items() if j != k}
    return times


def _time(x, end):
    """How long a level takes to the weir."""
    return log((x - end) / (1 - end)) / LOSS


def _above(k, waiting):
    """The first tank whose water comes to tank ``k``: the one after the last that is not full."""
    return max((j + 1 for j in waiting if j < k), default=0)
