"""Relays, with or without hysteresis, or state jumps, whose rates depend on each other, with events that coincide at theta = 1.

    x_i' = r_i(s) > 0,   x(0) = 0,   s_i = 1 from x_i = p_i + q_i theta on,   min w x(2) over theta

r_i(s) is one number for each set of events that have happened.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

import pyomo_fesd
from tests.problems.running import move

END, APART = 2.0, 0.3
#: A relay that is on stays on until its state is so far below its level.
OVERLAP = 0.2


@dataclass(frozen=True)
class Events:
    """Random numbers of one problem."""

    r: np.ndarray
    p: np.ndarray
    q: np.ndarray
    w: np.ndarray

    @classmethod
    def draw(cls, seed, number, time=1.0):
        """Return a random problem with ``number`` events at ``time`` for theta = 1."""
        random = np.random.default_rng(seed)
        r = random.uniform(0.5, 3, (number, 2**number))
        q, w = random.uniform(-1, 1, number), random.uniform(-1, 1, number)
        return cls(r, r[:, 0] * time - q, q, w)

    @classmethod
    def draw_after_early_one(cls, seed, number, early):
        """Return a random problem with ``number`` events at 1 for theta = 1, and one more at ``early``, whatever theta is."""
        random = np.random.default_rng(seed)
        r = random.uniform(0.5, 3, (number + 1, 2 ** (number + 1)))
        q, w = random.uniform(-1, 1, number + 1), random.uniform(-1, 1, number + 1)
        q[-1] = 0.0
        p = r[:, 0] * early + r[:, 2**number] * (1 - early) - q
        p[-1] = r[-1, 0] * early
        return cls(r, p, q, w)

    def with_last_after(self):
        """Return the problem whose last event comes after the others."""
        p = self.p.copy()
        p[-1] += self.r[-1, self.r.shape[1] // 2 - 1] * APART
        return replace(self, p=p)

    def objective(self, theta):
        """Return the exact objective."""
        x, s, left = np.zeros(len(self.p)), np.zeros(len(self.p), dtype=int), END
        while True:
            rate = self.r[:, int(s @ 2 ** np.arange(len(s)))]
            times = np.where(s == 1, np.inf, (self.p + self.q * theta - x) / rate)
            first = times.min()
            if first >= left:
                return float(self.w @ (x + rate * left))
            x, left = x + rate * first, left - first
            s[times <= first + 1e-12] = 1

    @property
    def slopes(self):
        """Those of the objective for smaller and for larger theta."""
        return [(self.objective(1 + step) - self.objective(1)) / 1e-5 for step in (-1e-5, 1e-5)]


def simulated(events, kind, nfe, times=(0, END)):
    """The model on a moving grid, simulated for theta = 1; ``kind`` is 'relay', 'hysteresis' or 'jump'."""
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(initialize=times), pyo.RangeSet(len(events.p))
    m.theta = pyo.Var(initialize=1, bounds=(0.5, 1.5))
    m.x, m.s = pyo.Var(m.t, m.i, initialize=0), pyo.Var(m.t, m.i, initialize=0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.x[0, ...].fix(0)
    m.level = pyo.Expression(m.i, rule=lambda m, i: events.p[i - 1] + events.q[i - 1] * m.theta)
    m.rate = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dx[t, i] == _interpolated(events.r[i - 1], [m.s[t, j] for j in m.i]))
    m.cost = pyo.Objective(expr=sum(events.w[i - 1] * m.x[END, i] for i in m.i))
    if kind == 'relay':
        m.law = Disjunction(m.t, m.i, rule=partial(_relay, overlap=0.0))
        pyo.TransformationFactory('fesd.dcs').apply_to(m)
    elif kind == 'hysteresis':
        m.law = Disjunction(m.t, m.i, rule=_relay)
        for i in m.i:
            m.law[0, i].disjuncts[0].indicator_var.fix(True)
        pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.law])
    else:
        m.ds = dae.DerivativeVar(m.s, wrt=m.t)
        m.s[0, ...].fix(0)
        m.still = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.ds[t, i] == 0)
        # beyond a jump the guard is far from zero
        m.law = pyomo_fesd.state_jump(
            m.i, m.t, guard=lambda m, i, t: m.level[i] + 20 * m.s[t, i] - m.x[t, i], reset=lambda m, i, t: [(m.s[t, i], 1)]
        )
    move(m, nfe, 1)
    m.theta.fix(1)
    pyomo_fesd.simulate(m)
    m.theta.unfix()
    return m


def _relay(m, t, i, overlap=OVERLAP):
    return [[m.x[t, i] <= m.level[i], m.s[t, i] == 0], [m.x[t, i] >= m.level[i] - overlap, m.s[t, i] == 1]]


def _interpolated(values, s):
    """The number for the events ``s``, each 0 or 1."""
    if not s:
        return values[0]
    off, on = (_interpolated(values[k::2], s[1:]) for k in (0, 1))
    return off + s[0] * (on - off)
