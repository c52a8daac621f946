"""A switch exactly at the boundary t = 1 of two control stages for the decision p = 0, with exact one-sided slopes.

    dx = 1 below x = 1 + p, s above it,   x(0) = 0,   min v x(1) + g x(2) + w p

For p < 0 the switch lies in the first stage, for p > 0 in the second one.  At x(1), and between x(1) and x(2), there may be
conditions, which are active for p = 0.
"""

from dataclasses import dataclass

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

import pyomo_fesd
from tests.problems.running import transform

STEP = 1e-5
#: What x(1) and x(2) must satisfy, for the rate s after the switch: at least 0.
CONDITIONS = {
    'none': lambda first, last, s: 1.0,
    'at least': lambda first, last, s: first - 1,
    'at most': lambda first, last, s: 1 - first,
    'gains at most': lambda first, last, s: s - last + first,
    'gains at least': lambda first, last, s: last - first - s,
}


@dataclass(frozen=True)
class Boundary:
    """One problem; with ``by_bound`` the condition is a bound of x(1)."""

    s: float
    v: float
    g: float
    w: float
    condition: str = 'none'
    by_bound: bool = False

    def _last(self, p):
        switch = 1 + p
        return (1 if p >= 0 else switch - self.s * p), switch + self.s * (2 - switch)

    def _objective(self, p):
        first, last = self._last(p)
        return self.v * first + self.g * last + self.w * p

    @property
    def slopes(self):
        """Those of the objective for smaller and for larger p; infinite where the condition excludes them."""
        excluded = [CONDITIONS[self.condition](*self._last(p), self.s) < -1e-9 for p in (-STEP, STEP)]
        slopes = [(self._objective(p) - self._objective(0)) / STEP for p in (-STEP, STEP)]
        return np.where(excluded, np.inf, slopes)

    def build(self, nfe, ncp, scheme):
        """The model at p = 0."""
        m = pyo.ConcreteModel()
        m.t = dae.ContinuousSet(initialize=[0, 1, 2])
        m.p, m.u = pyo.Var(bounds=(-1, 1), initialize=0), pyo.Var(m.t, initialize=0)
        m.x = pyo.Var(m.t, initialize=lambda m, t: t)
        m.dx = dae.DerivativeVar(m.x)
        m.x[0].fix(0)
        m.u[:].fix(0)
        m.law = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1 + m.p, m.dx[t] == 1], [m.x[t] >= 1 + m.p, m.dx[t] == self.s]])
        m.cost = pyo.Objective(expr=self.v * m.x[1] + self.g * m.x[2] + self.w * m.p)
        if self.by_bound:
            (m.x[1].setlb if self.condition == 'at least' else m.x[1].setub)(1)
        elif self.condition != 'none':
            m.condition = pyo.Constraint(expr=CONDITIONS[self.condition](m.x[1], m.x[2], self.s) >= 0)
        transform(m, nfe, ncp, scheme=scheme, piecewise_constant=[m.u])
        m.p.fix(0)
        pyomo_fesd.simulate(m)
        m.p.unfix()
        return m
