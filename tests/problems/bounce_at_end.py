"""A ball that meets the floor exactly at the last time for theta = 1, and later for a larger theta.

    q' = v,   v' = -1,   q(0) = theta <= 1,   v(0) = 0,   0 <= t <= sqrt(2),   min a q(sqrt(2)) + b theta

For theta < 1 the ball meets the floor at sqrt(2 theta), and rises by e sqrt(2 theta) (sqrt(2) - sqrt(2 theta)) until the end, to
first order: the objective falls for smaller theta if a e < b.
"""

from dataclasses import dataclass

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd
from tests.models import dcs
from tests.problems.running import move

END = 2**0.5


@dataclass(frozen=True)
class Ball:
    """Restitution e, and a and b of the objective."""

    e: float
    a: float
    b: float

    @property
    def slope(self):
        """That of the objective towards smaller theta."""
        return self.a * self.e - self.b

    def simulated(self, nfe):
        """The model on ``nfe`` elements, simulated for theta = 1."""
        m = pyo.ConcreteModel()
        m.t = dae.ContinuousSet(bounds=(0, END))
        m.theta = pyo.Var(initialize=1, bounds=(0.5, 1))
        m.q, m.v = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=0)
        m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
        m.start = pyo.Constraint(expr=m.q[0] == m.theta)
        m.v[0].fix(0)
        m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.q[t], restitution=self.e)
        m.velocity = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
        m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -1 + m.floor[t].normal)
        m.cost = pyo.Objective(expr=self.a * m.q[END] + self.b * m.theta)
        move(dcs(m), nfe, 2)
        m.theta.fix(1)
        pyomo_fesd.simulate(m)
        m.theta.unfix()
        return m
