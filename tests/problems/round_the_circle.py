"""A point that is driven to the right at rate 1 and meets the unit circle, an obstacle: from (-2, 0.1), 0 <= t <= 3.

    dx/dt = (1, 0) + grad c lam,   0 <= lam  perp  c = |x|^2 - 1 >= 0

Contact where x = -sqrt(1 - 0.01).  On the circle the angle a to the x-axis follows da/dt = -sin a, so tan(a/2) falls like exp(-t);
the point would leave at the top, a = pi/2.
"""

from math import asin, atan, cos, exp, log, pi, sin, sqrt, tan

import pyomo.dae as dae
import pyomo.environ as pyo

from pyomo_fesd import projection

START, HORIZON = (-2.0, 0.1), 3.0
CONTACT = 2 - sqrt(0.99)
_TAN = tan((pi - asin(0.1)) / 2)
LEAVES = CONTACT + log(_TAN)  # 3.998...


def exact(t):
    """Where the point is while it slides."""
    angle = 2 * atan(_TAN * exp(CONTACT - t))
    return cos(angle), sin(angle)


def build(wall=lambda x, y: x**2 + y**2 - 1, metric=None, horizon=HORIZON, start=START):
    m = plant(horizon, start)

    @m.Block(m.t)
    def circle(b, t):
        m = b.model()
        x = [m.x[t, 1], m.x[t, 2]]
        push = projection(b, wall(*x), x, metric)
        b.ode = pyo.Constraint(m.i, rule=lambda b, i: m.dx[t, i] == (1, 0)[i - 1] + push[m.x[t, i]])

    return m


def plant(horizon=HORIZON, start=START):
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, horizon)), pyo.RangeSet(2)
    m.x = pyo.Var(m.t, m.i, initialize=lambda m, t, i: start[i - 1])
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i in m.i:
        m.x[0, i].fix()
    return m
