"""Two relays whose rates depend on each other, with switches that coincide at theta = 1.

    x_i' = r_i(s_1, s_2) > 0,   x(0) = 0,   s_i = 1 where x_i >= p_i + q_i theta,   min w_1 x_1(2) + w_2 x_2(2) over theta

p is such that both switch at one time for theta = 1.  The objective is piecewise linear with a kink there: one order for larger
theta, the other one for smaller theta.
"""

from dataclasses import dataclass

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo

END = 2.0


@dataclass(frozen=True)
class Relays:
    """Random numbers of one problem."""

    r: np.ndarray
    p: np.ndarray
    q: np.ndarray
    w: np.ndarray

    @classmethod
    def draw(cls, seed):
        """Return a random problem."""
        random = np.random.default_rng(seed)
        r, q, tau = random.uniform(0.5, 3, (2, 2, 2)), random.uniform(-1, 1, 2), random.uniform(0.5, 1.4)
        return cls(r, r[:, 0, 0] * tau - q, q, random.uniform(-1, 1, 2))

    def objective(self, theta):
        """Return the exact objective."""
        return float(self.w @ self.last(theta))

    def last(self, theta):
        """Return the exact last states."""
        return self._run(theta)[0]

    def seconds(self, theta):
        """Return how long each relay has been on at the end, exactly."""
        return self._run(theta)[1]

    def _run(self, theta):
        x, s, left, on = np.zeros(2), [0, 0], END, np.zeros(2)
        while True:
            rate, to_go = self.r[:, s[0], s[1]], self.p + self.q * theta - x
            times = [np.inf if s[i] else to_go[i] / rate[i] for i in range(2)]
            first = int(np.argmin(times))
            if times[first] >= left:
                return x + rate * left, on + left * np.array(s)
            x, left, on = x + rate * times[first], left - times[first], on + times[first] * np.array(s)
            s[first] = 1

    @property
    def is_minimum(self):
        """Whether theta = 1 is a local minimum."""
        return min(self.objective(1 + step) for step in (-1e-5, 1e-5)) >= self.objective(1) - 1e-12


def build(relays, more=lambda m: None, times=(0, END)):
    """The problem as a model; ``more`` adds to it; ``times`` are the boundaries of control stages."""
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(initialize=times), pyo.RangeSet(2)
    m.theta = pyo.Var(initialize=1, bounds=(0.5, 1.5))
    m.x, m.s = pyo.Var(m.t, m.i, initialize=0), pyo.Var(m.t, m.i, initialize=0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.x[0, ...].fix(0)

    @m.Disjunction(m.t, m.i)
    def law(m, t, i):
        threshold = relays.p[i - 1] + relays.q[i - 1] * m.theta
        return [[m.x[t, i] <= threshold, m.s[t, i] == 0], [m.x[t, i] >= threshold, m.s[t, i] == 1]]

    @m.Constraint(m.t, m.i)
    def rate(m, t, i):
        (a, b), (c, d) = relays.r[i - 1]
        first, second = m.s[t, 1], m.s[t, 2]
        return m.dx[t, i] == a + (c - a) * first + (b - a) * second + (a - b - c + d) * first * second

    m.cost = pyo.Objective(expr=sum(relays.w[i - 1] * m.x[END, i] for i in m.i))
    more(m)
    return m
