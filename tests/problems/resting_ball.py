"""A ball that does not bounce: v+ = 0 at the impact, then the floor carries it with the force F per mass, 0 <= F perp q >= 0."""

import pyomo.environ as pyo
from bouncing_ball import FIRST, GRAVITY, HEIGHT
from problems.states import over_time
from pyomo.mpec import Complementarity, complements

import pyomo_fesd

IMPACT, FORCE, END = FIRST, GRAVITY, 1.0


def build():
    m = over_time(END, q=HEIGHT, v=0)
    m.F = pyo.Var(m.t, initialize=0, bounds=(0, None))
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.newton = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == m.F[t] - GRAVITY)
    m.contact = Complementarity(m.t, rule=lambda m, t: complements(m.F[t] >= 0, m.q[t] >= 0))
    m.impact = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], 0)])
    return m
