"""A state that reaches a surface exactly at the last time, on which it would slide; its place is free.

    x' = r_0 > 0 where x < p,  r_1 < 0 where x > p,   y' = c_0,  and c_0 + c_1 on the other side,   x(0) = y(0) = 0
    min w_0 x(1) + w_1 y(1) + w_2 p,   at p = r_0

A smaller p makes x slide from t = p / r_0 on, with the weight r_0 / (r_0 - r_1) of the mode beyond; a larger one is not reached.
"""

from dataclasses import dataclass

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction


@dataclass(frozen=True)
class Slide:
    """Random numbers of one problem."""

    r: tuple
    c: np.ndarray
    w: np.ndarray

    @classmethod
    def draw(cls, seed):
        """Return a random problem."""
        random = np.random.default_rng(seed)
        return cls((random.uniform(0.5, 3), -random.uniform(0.5, 3)), random.uniform(-2, 2, 2), random.uniform(-1, 1, 3))

    def objective(self, p):
        """Return the exact objective."""
        (r, s), (c, d) = self.r, self.c
        sliding = max(0.0, 1 - p / r)
        return float(self.w @ (min(r, p), c + d * r / (r - s) * sliding, p))

    @property
    def is_minimum(self):
        """Whether p = r_0 is a local minimum."""
        at = self.r[0]
        return min(self.objective(at + step) for step in (-1e-5, 1e-5)) >= self.objective(at) - 1e-12


def build(slide, relay=False):
    """The problem as a model, with an independent relay with hysteresis, ``m.relay``, if asked for."""
    (r, s), (c, d) = slide.r, slide.c
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.p = pyo.Var(initialize=r, bounds=(0.1, r + 1))
    m.x, m.y, m.beyond = (pyo.Var(m.t, initialize=0) for _ in range(3))
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.x[0].fix(0)
    m.y[0].fix(0)

    @m.Disjunction(m.t)
    def law(m, t):
        return [[m.x[t] <= m.p, m.beyond[t] == 0], [m.x[t] >= m.p, m.beyond[t] == 1]]

    m.rate = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == r + (s - r) * m.beyond[t])
    m.other_rate = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == c + d * m.beyond[t])
    if relay:
        m.q = pyo.Var(m.t, initialize=0)
        m.dq = dae.DerivativeVar(m.q)
        m.q[0].fix(0)
        m.relay = Disjunction(m.t, rule=lambda m, t: [[m.q[t] <= 0.4, m.dq[t] == 1], [m.q[t] >= 0.2, m.dq[t] == -1]])
    m.cost = pyo.Objective(expr=slide.w[0] * m.x[1] + slide.w[1] * m.y[1] + slide.w[2] * m.p)
    return m
