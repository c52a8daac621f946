"""A surface that is reached exactly at the last time, or left at the first one, at the decision p = 0, with exact one-sided slopes.

    last    dx = 1 below x = 1, s above it,   x(0) = p;       x(1) = 1 + p for p <= 0, 1 + s p for p >= 0, where s < 0 slides: 1
    first   dx = 1 above x = p, s > 0 below it,   x(0) = 0;   x(1) = 1 for p <= 0, 1 + p (1 - 1/s) for p >= 0

min g x(1) + w p.  At p = 0 only elements on one side of the surface have an extent.
"""

from dataclasses import dataclass

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

from tests.problems.running import transform


@dataclass(frozen=True)
class Surface:
    """One problem; ``is_first`` is whether the surface is left at the first time."""

    is_first: bool
    s: float
    g: float
    w: float

    @property
    def slopes(self):
        """Those of the objective to the left and to the right of p = 0."""
        if self.is_first:
            return self.w, self.g * (1 - 1 / self.s) + self.w
        return self.g + self.w, self.g * max(self.s, 0.0) + self.w

    def build(self, nfe, ncp, scheme, more=lambda m: None):
        """The problem as a model on elements, p at most 0; ``more`` adds to it before it is transformed."""
        m = pyo.ConcreteModel()
        m.t = dae.ContinuousSet(bounds=(0, 1))
        m.p = pyo.Var(bounds=(-1, 0), initialize=-0.3)
        m.x = pyo.Var(m.t, initialize=lambda m, t: t if self.is_first else t - 0.3)
        m.dx = dae.DerivativeVar(m.x)
        if self.is_first:
            m.x[0].fix(0)
        else:
            m.begin = pyo.Constraint(expr=m.x[0] == m.p)
        surface, inside = (m.p, 1) if self.is_first else (1, -1)

        def modes(m, t):
            distance = inside * (m.x[t] - surface)
            return [[distance >= 0, m.dx[t] == 1], [distance <= 0, m.dx[t] == self.s]]

        m.law = Disjunction(m.t, rule=modes)
        m.cost = pyo.Objective(expr=self.g * m.x[1] + self.w * m.p)
        more(m)
        return transform(m, nfe, ncp, scheme=scheme)
