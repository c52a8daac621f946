"""A bouncing ball with quadratic drag, v' = -g - k v |v|, v+ = -e v: |v| = 2 max(0, v) - v is a kink of a state that jumps.

Closed form: falling from rest at height q the speed after the way s is v^2 = (g/k) (1 - exp(-2 k s)); rising with v it reaches
log(1 + k v^2/g)/(2 k).
"""

from math import acosh, atan, exp, log, sqrt, tanh

import pyomo.environ as pyo
from problems.states import over_time

import pyomo_fesd
from pyomo_fesd.core import add_positive_part, declare_positive_part

GRAVITY, DRAG, RESTITUTION, HEIGHT = 9.81, 0.3, 0.7, 0.8


def fall(height):
    """Time and speed at the ground."""
    speed = sqrt(GRAVITY / DRAG * (1 - exp(-2 * DRAG * height)))
    return acosh(exp(DRAG * height)) / sqrt(GRAVITY * DRAG), speed


def rise(speed):
    """Time to the top and its height."""
    return atan(speed * sqrt(DRAG / GRAVITY)) / sqrt(GRAVITY * DRAG), log(1 + DRAG * speed**2 / GRAVITY) / (2 * DRAG)


def events():
    """Two impacts and the top between them."""
    first, speed = fall(HEIGHT)
    up, top = rise(RESTITUTION * speed)
    return first, first + up, first + up + fall(top)[0]


END = 0.9
SINCE = END - events()[1]
FINAL = -sqrt(GRAVITY / DRAG) * tanh(SINCE * sqrt(GRAVITY * DRAG))  # v at the end, falling from the top


def build(nfe=12, ncp=4, scheme='LAGRANGE-RADAU'):
    """Discretised, as the kink is added point by point."""
    m = over_time(END, q=HEIGHT, v=0)
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=nfe, ncp=ncp, scheme=scheme)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.up = pyo.Block()
    declare_positive_part(m.up, m.t)

    def newton(m, t):
        size = 2 * add_positive_part(m.up, (t,), m.v[t]) - m.v[t]
        return m.dv[t] == -GRAVITY - DRAG * m.v[t] * size

    m.newton = pyo.Constraint(m.t, rule=newton)
    m.impact = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -RESTITUTION * m.v[t])])
    return m
