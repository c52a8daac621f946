"""A block that lands, and must not slip, exactly at the boundary of a control stage for theta = 1.

    y' = w,   w' = -g + normal,   y(0) = g theta^2 / 2,   w(0) = 0,   z' = c (w / g)^2,   min z(2) - a theta

with c = c_1 until t = 1, c_2 from there on.  It lands at t = theta and rests: dz(2)/dtheta is c_1 below theta = 1, c_2 above.
"""

from dataclasses import dataclass

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd
from tests.problems.running import move

G, BOUNDARY, END = 10.0, 1, 2


@dataclass(frozen=True)
class Landing:
    """c_1, c_2 and a of the objective."""

    before: float
    after: float
    a: float

    @property
    def slopes(self):
        """Those of the objective for smaller and for larger theta."""
        return self.a - self.before, self.after - self.a

    def solved(self, nfe):
        """The model on ``nfe`` elements, solved for theta = 1."""
        m = pyo.ConcreteModel()
        m.t = dae.ContinuousSet(initialize=[0, BOUNDARY, END])
        m.theta = pyo.Var(initialize=1, bounds=(0.5, 1.5))
        m.y, m.z = pyo.Var(m.t, initialize=G / 2), pyo.Var(m.t, initialize=0)
        m.v, m.w = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
        m.dy, m.dz, m.dv, m.dw = (dae.DerivativeVar(state, wrt=m.t) for state in (m.y, m.z, m.v, m.w))
        m.c = pyo.Var(m.t, initialize=lambda m, t: self.before if t <= BOUNDARY else self.after)
        m.c.fix()
        m.start = pyo.Constraint(expr=m.y[0] == G / 2 * m.theta**2)
        for state in (m.z, m.v, m.w):
            state[0].fix(0)
        m.table = pyomo_fesd.contact(m.t, gap=lambda m, t: m.y[t], friction=0.5, slip=lambda m, t: m.v[t], sticks=True)
        m.across = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.w[t])
        m.slide = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == m.table[t].friction)
        m.press = pyo.Constraint(m.t, rule=lambda m, t: m.dw[t] == -G + m.table[t].normal)
        m.cost_rate = pyo.Constraint(m.t, rule=lambda m, t: m.dz[t] == m.c[t] * (m.w[t] / G) ** 2)
        m.cost = pyo.Objective(expr=m.z[END] - self.a * m.theta)
        move(m, nfe, 2, piecewise_constant=[m.c])
        m.theta.fix(1)
        pyo.SolverFactory('mpec_hybrid').solve(m)
        m.theta.unfix()
        return m
