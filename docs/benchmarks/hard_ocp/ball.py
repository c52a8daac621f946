"""A ball is thrown at a target: least effort, and bounces help; elastic contact, restitution 0.9.

    v_1' = u_1,    v_2' = u_2 - g + N,    0 <= N perp q_2 >= 0,    v_2+ = -0.9 v_2- at an impact

From (0, 0.5) at rest to q = (4, 0.5) at T = 4; |u| <= 9, u is constant on each of 20 stages: min int |u|^2 dt + 100 |v(T)|^2.

Source: problem 'throwing a ball' of NOSNOC.
"""

from math import log, pi, sqrt

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.hard_ocp import grid, replay

import pyomo_fesd

HORIZON, STAGES, ELEMENTS, NCP = 4.0, 20, 5, 4
G, RESTITUTION = 9.81, 0.9
START, GOAL = (0.0, 0.5), (4.0, 0.5)
U_MAX = 9.0
U_RANGE, CONTROLS = (-U_MAX, U_MAX), 2
#: Time-freezing in nosnoc: the stiffness of the auxiliary spring, and the range of the speed of time.
STIFFNESS, SPEED = 10.0, (1.0, 25.0)


def final_cost(q, v):
    """Cost of the state at the end."""
    return 100 * sum(speed**2 for speed in v)


def build(form='contact', **options):
    """The transformed model in one of ``FORMS``; ``options`` are those of the form and of ``fesd.finite_elements``."""
    return FORMS[form](**options)


def _with_contact(elements=ELEMENTS, ncp=NCP, **options):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=grid.ends(HORIZON, STAGES))
    m.i = pyo.RangeSet(2)
    m.q = pyo.Var(m.i, m.t, initialize=lambda m, i, t: START[i - 1])
    m.v, m.u = pyo.Var(m.i, m.t, initialize=0), pyo.Var(m.i, m.t, initialize=0)
    m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    m.q[:, 0].fix()
    m.v[:, 0].fix()
    for i in m.i:
        m.q[i, HORIZON].fix(GOAL[i - 1])
    m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.q[2, t], restitution=RESTITUTION)
    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.v[i, t])
    m.along = pyo.Constraint(m.t, rule=lambda m, t: m.dv[1, t] == m.u[1, t])
    m.up = pyo.Constraint(m.t, rule=lambda m, t: m.dv[2, t] == m.u[2, t] - G + m.floor[t].normal)
    m.limit = pyo.Constraint(m.t, rule=lambda m, t: m.u[1, t] ** 2 + m.u[2, t] ** 2 <= U_MAX**2)
    m.effort = dae.Integral(m.t, rule=lambda m, t: m.u[1, t] ** 2 + m.u[2, t] ** 2)
    m.cost = pyo.Objective(expr=m.effort + final_cost(None, [m.v[i, HORIZON] for i in m.i]))
    return grid.moving_grid(m, elements, [m.u], ncp=ncp, **options)


#: The forms of the model.
FORMS = {'contact': _with_contact}


def controls(m):
    """Controls of each stage: (stages, 2)."""
    return np.array([[m.u[i, t].value for i in m.i] for t in grid.ends(HORIZON, STAGES)[1:]])


PLANT = replay.Plant(
    mass=np.ones(2),
    force=lambda q, v, u: np.array([u[0], u[1] - G]),
    gap=lambda q: q[1:],
    normal=lambda q: np.array([[0.0, 1.0]]) + 0 * q[0],
    rate=lambda q, v, u, stage: u @ u,
    restitution=RESTITUTION,
)
AT_START = (START, (0.0, 0.0))
#: Bounds of positions and velocities.
BOUNDS = (-np.inf, np.inf, np.inf)


def missed(outcome):
    """Distance to the target."""
    return float(np.abs(outcome.q - GOAL).max())


def twin():
    """The same problem in nosnoc by elastic time-freezing: below the floor a damped spring returns the ball in frozen time."""
    import casadi as ca
    from benchmarks.hard_ocp import nosnoc_peer

    q, v, t, u, speed = nosnoc_peer.symbols(2, 2)
    alpha, decay = ca.SX.sym('alpha'), abs(log(RESTITUTION))
    damping = 2 * decay * sqrt(STIFFNESS / (decay**2 + pi**2))
    flight = speed * ca.vertcat(v, u[0], u[1] - G, 1)
    bounce = speed * ca.vertcat(0, v[1], 0, -STIFFNESS * q[1] - damping * v[1], 0)
    given = {
        'x': ca.vertcat(q, v, t),
        'u': ca.vertcat(u, speed),
        't_var': t,
        'alpha': [alpha],
        'c': [q[1]],
        'f_x': [alpha * flight + (1 - alpha) * bounce],
    }
    costs = {
        'f_q': speed * ca.sumsqr(u),
        'f_terminal': final_cost(None, ca.vertsplit(v)),
        'g_terminal': q - np.array(GOAL),
        'g_path': ca.sumsqr(u),
        'lbg': np.array([-np.inf]),
        'ubg': np.array([U_MAX**2]),
    }
    far = np.full(4, np.inf)
    return nosnoc_peer.Twin(given, (-far, far, SPEED), costs, {'time_freezing_tolerance': 0.0}, {'max_iter': 1000})
