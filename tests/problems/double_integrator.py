"""Double integrator: dq/dt = v, dv/dt = -1 above q = 1/2 and -1/4 below, q(0) = 1, v(0) = 0, 0 <= t <= 2.

q reaches 1/2 at t = 1 with v = -1 and ends at q(2) = -0.625, v(2) = -1.25.  The second derivative of q is an output of its own.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from problems.states import over_time
from pyomo.gdp import Disjunction

SWITCH, FINAL_Q, FINAL_V = 1.0, -0.625, -1.25
ACCELERATIONS = (-1.0, -0.25)  # before and after


def build():
    m = over_time(2, q=1, v=0)
    m.ddq = dae.DerivativeVar(m.q, wrt=(m.t, m.t))
    m.speed = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.ground = Disjunction(m.t, rule=lambda m, t: [[m.q[t] >= 0.5, m.dv[t] == -1], [m.q[t] <= 0.5, m.dv[t] == -0.25]])
    return m
