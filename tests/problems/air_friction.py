"""A ball with Coulomb friction in air: q' = v, v' = -g - mu sgn(v), impacts v+ = -e v where q = 0; the state that decides jumps.

Between events everything is a parabola, so they follow from quadratic equations.
"""

from math import sqrt

import pyomo.environ as pyo
from problems.states import over_time
from pyomo.gdp import Disjunction

import pyomo_fesd

GRAVITY, FRICTION, RESTITUTION = 9.81, 2.0, 0.8
START, END = (0.8, -0.1), 1.2


def exact():
    """Times of impacts, times at which the ball turns at the top, and (q, v) at the end."""
    t, (q, v), impacts, tops = 0.0, START, [], []
    while True:
        falling = v <= 0
        a = -GRAVITY + FRICTION if falling else -GRAVITY - FRICTION
        h = (-v - sqrt(v * v - 2 * a * q)) / a if falling else -v / a
        if t + h > END:
            h = END - t
            return impacts, tops, (q + v * h + a * h * h / 2, v + a * h)
        t, q, v = t + h, q + v * h + a * h * h / 2, v + a * h
        (impacts if falling else tops).append(t)
        q, v = (0.0, -RESTITUTION * v) if falling else (q, 0.0)


def build():
    m = over_time(END, q=START[0], v=START[1])
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.drag = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.v[t] >= 0, m.dv[t] == -GRAVITY - FRICTION],
            [m.v[t] <= 0, m.dv[t] == -GRAVITY + FRICTION],
        ],
    )
    m.impact = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -RESTITUTION * m.v[t])])
    return m
