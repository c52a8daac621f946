"""A cascade of S tanks, each of which overflows into the next: a model with any number of switching subsystems.

    dx_k/dt = feed_k + q_{k-1} - q_k,      q_k = 0 where x_k < 1,   q_k = WEIR (x_k - 1) where x_k > 1

The first tank of each of up to four groups starts below its weir and fills; the others start full, in steady state.
"""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction
from scipy.linalg import expm
from scipy.optimize import brentq

HORIZON, WEIR = 10.0, 4.0
#: Feed of the first tank, and of all the others together.
FIRST, TOGETHER = 1.0, 1.0
#: Initial distance of each group's first tank to its weir.
DEFICITS = (2.0, 0.8, 1.3, 1.8)


def heads(S):
    """``{tank: distance to its weir}`` of the first tanks of the groups."""
    groups = min(S, len(DEFICITS))
    return {round(k * S / groups): DEFICITS[k] for k in range(groups)}


def feeds(S):
    """Feed of each tank."""
    return np.array([FIRST, *[TOGETHER / S] * (S - 1)])


def start(S):
    """Initial levels."""
    levels, flow, first = [], 0.0, heads(S)
    for k, feed in enumerate(feeds(S)):
        flow = 0.0 if k in first else flow + feed
        levels.append(1 - first[k] if k in first else 1 + flow / WEIR)
    return np.array(levels)


def build(S):
    """The model of S tanks."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, HORIZON))
    m.tank = pyo.RangeSet(0, S - 1)
    feed, given = feeds(S), start(S)
    m.x = pyo.Var(m.tank, m.t, initialize=lambda m, k, t: given[k])
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.q = pyo.Var(m.tank, m.t, initialize=0.0)
    for k in m.tank:
        m.x[k, 0].fix()

    @m.Constraint(m.tank, m.t)
    def balance(m, k, t):
        return m.dx[k, t] == feed[k] + (m.q[k - 1, t] if k else 0.0) - m.q[k, t]

    @m.Disjunct(m.tank, m.t)
    def low(d, k, t):
        d.region = pyo.Constraint(expr=d.model().x[k, t] <= 1)
        d.flow = pyo.Constraint(expr=d.model().q[k, t] == 0)

    @m.Disjunct(m.tank, m.t)
    def full(d, k, t):
        d.region = pyo.Constraint(expr=d.model().x[k, t] >= 1)
        d.flow = pyo.Constraint(expr=d.model().q[k, t] == WEIR * (d.model().x[k, t] - 1))

    m.weir = Disjunction(m.tank, m.t, rule=lambda m, k, t: [m.low[k, t], m.full[k, t]])
    return m


def exact(S):
    """Switching times, at which first tanks become full, in order; the system is linear between them."""
    x, waiting, times, now = start(S), set(heads(S)), [], 0.0
    while True:
        levels = _levels(S, waiting, x)
        full = levels(HORIZON - now) > 1
        ends = {k: _first_time(levels, k, HORIZON - now) for k in waiting if full[k]}
        if not ends:
            return times
        k = min(ends, key=ends.get)
        x, now = levels(ends[k]), now + ends[k]
        waiting.remove(k)
        times.append(now)


def _levels(S, waiting, x):
    """``time -> levels`` from ``x``, with the overflows of all tanks that are not ``waiting``."""
    flows = np.diag([0.0 if k in waiting else WEIR for k in range(S)])
    # of the levels above the weir and of a constant state 1
    A = np.zeros((S + 1, S + 1))
    A[:S, :S] = np.eye(S, k=-1) @ flows - flows
    A[:S, S] = feeds(S)
    return lambda s: (expm(A * s) @ np.append(x - 1, 1.0))[:S] + 1


def _first_time(levels, k, last):
    return brentq(lambda s: levels(s)[k] - 1, 0, last, xtol=1e-13)
