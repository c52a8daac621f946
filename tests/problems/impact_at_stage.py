"""A body that meets the floor exactly at the boundary of two control stages for theta = 1, and leaves it at once.

    y' = v,   v' = f + normal,   z' = c y,   y(0) = theta y_0,   v(0) = v_0,   0 <= t <= 2,   min z(2) + w (theta - 1)

f = a < 0 and c = c_1 until t = 1, f = b > 0 and c_2 from there on; y_0 is such that it meets the floor at t = 1 for theta = 1.  If
it does earlier it stays there until t = 1; if it does later it leaves at once.
"""

from dataclasses import dataclass

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd
from tests.problems.running import move

#: Step of the one-sided slopes.
STEP = 1e-6


@dataclass(frozen=True)
class Impact:
    """a, b, v_0, c_1, c_2 and w."""

    a: float
    b: float
    v: float
    before: float
    after: float
    w: float

    @classmethod
    def draw(cls, seed):
        """One whose slopes differ by more than they lie above or below zero."""
        rng = np.random.default_rng(seed)
        free = cls(rng.uniform(-3, -0.2), rng.uniform(0.1, 3), rng.uniform(-2, -0.3), *rng.normal(size=2), 0.0)
        below, above = free.slopes
        return cls(*list(vars(free).values())[:-1], rng.uniform(-1.5, 1.5) * abs(below + above) / 2 + (below - above) / 2)

    @property
    def y(self):
        """y_0."""
        return -self.v - self.a / 2

    def objective(self, theta):
        """Its exact value."""
        y, v = theta * self.y, self.v
        hits = (-v - np.sqrt(v**2 - 2 * self.a * y)) / self.a
        h = min(hits, 1.0)
        cost = self.before * _integral(y, v, self.a, h)
        y, v = (0.0, 0.0) if hits < 1 else (max(0.0, y + v + self.a / 2), v + self.a)
        h = 0.0 if hits < 1 else (-v - np.sqrt(v**2 - 2 * self.b * y)) / self.b
        cost += self.after * (_integral(y, v, self.b, h) + _integral(0.0, 0.0, self.b, 1 - h))
        return cost + self.w * (theta - 1)

    @property
    def slopes(self):
        """Those of the objective for smaller and for larger theta."""
        return tuple((self.objective(1 + sign * STEP) - self.objective(1)) / STEP for sign in (-1, 1))

    def simulated(self, nfe):
        """The model on ``nfe`` elements, simulated for theta = 1."""
        m = pyo.ConcreteModel()
        m.t = dae.ContinuousSet(initialize=(0, 1, 2))
        m.y, m.v, m.z = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
        m.theta = pyo.Var(initialize=1, bounds=(0.5, 1.5))
        m.dy, m.dv, m.dz = (dae.DerivativeVar(state, wrt=m.t) for state in (m.y, m.v, m.z))
        m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.y[t])
        m.f = pyo.Var(m.t, initialize=lambda m, t: self.a if t <= 1 else self.b)
        m.c = pyo.Var(m.t, initialize=lambda m, t: self.before if t <= 1 else self.after)
        for given in (m.f, m.c):
            given.fix()
        m.velocity = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.v[t])
        m.press = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == m.f[t] + m.floor[t].normal)
        m.rate = pyo.Constraint(m.t, rule=lambda m, t: m.dz[t] == m.c[t] * m.y[t])
        m.start = pyo.Constraint(expr=m.y[0] == m.theta * self.y)
        m.v[0].fix(self.v)
        m.z[0].fix(0)
        m.cost = pyo.Objective(expr=m.z[2] + self.w * (m.theta - 1))
        move(m, nfe, 3, piecewise_constant=[m.f, m.c])
        m.theta.fix(1)
        pyomo_fesd.simulate(m)
        m.theta.unfix()
        return m


def _integral(y, v, f, h):
    return y * h + v * h**2 / 2 + f * h**3 / 6
