"""Sliding-mode optimal control: two curved switching surfaces, on both of which the way to the goal slides.

    q_i' = v_i - sgn(c_i),   v' = u,   c_1 = q_1 + 0.15 q_2^2,   c_2 = q_2 - 0.05 q_1^3,   |u_i| <= 10

From q = (2 pi/3, pi/3), v = 0 to q = (-pi/6, -pi/4) at T = 4 with min int |v|^2 dt; u is constant on each of 6 stages.

Source: problem 'sliding mode OCP' of NOSNOC.
"""

from functools import partial
from math import pi

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.ocp import replay
from benchmarks.ocp.discretisation import moving_grid

HORIZON, STAGES, ELEMENTS, NCP = 4.0, 6, 6, 2
START, GOAL = (2 * pi / 3, pi / 3, 0.0, 0.0), (-pi / 6, -pi / 4)
U_MAX = 10.0
U_RANGE, CONTROLS = (-U_MAX, U_MAX), 2
REFERENCE = 5.592183


def build(stages=STAGES):
    """The model with the given number of control stages, as a user writes it."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=np.linspace(0, HORIZON, stages + 1).tolist())
    m.i = pyo.RangeSet(2)
    m.q = pyo.Var(m.t, m.i, initialize=lambda m, t, i: START[i - 1])
    m.v = pyo.Var(m.t, m.i, initialize=0)
    m.u = pyo.Var(m.t, m.i, initialize=0, bounds=(-U_MAX, U_MAX))
    m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    for i in m.i:
        m.q[0, i].fix(START[i - 1])
        m.v[0, i].fix(0)
    m.goal = pyo.Constraint(m.i, rule=lambda m, i: m.q[HORIZON, i] == GOAL[i - 1])
    m.speed = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dv[t, i] == m.u[t, i])
    m.c = pyo.Expression(m.t, m.i, rule=surface)

    @m.Disjunction(m.t, m.i)
    def sgn(m, t, i):
        return [
            [m.c[t, i] >= 0, m.dq[t, i] == m.v[t, i] - 1],
            [m.c[t, i] <= 0, m.dq[t, i] == m.v[t, i] + 1],
        ]

    m.effort = dae.Integral(m.t, rule=lambda m, t: m.v[t, 1] ** 2 + m.v[t, 2] ** 2)
    m.cost = pyo.Objective(expr=m.effort)
    return m


def surface(m, t, i):
    """The two switching functions."""
    return m.q[t, 1] + 0.15 * m.q[t, 2] ** 2 if i == 1 else m.q[t, 2] - 0.05 * m.q[t, 1] ** 3


def discretise(m, elements=ELEMENTS, ncp=NCP, scheme='LAGRANGE-RADAU'):
    """Apply ``fesd.dcs`` and the moving grid, with ``elements`` elements in each control stage."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    return moving_grid(m, elements, ncp, scheme)


def plant(x, u):
    """For ``replay``: both relays and the rate of the cost."""
    q1, q2, v1, v2 = x
    f, g = np.array([v1, v2, *u]), -np.eye(4)[:, :2]
    surfaces = np.array([q1 + 0.15 * q2**2, q2 - 0.05 * q1**3])
    gradients = np.array([[1, 0.3 * q2, 0, 0], [-0.15 * q1**2, 1, 0, 0]])
    return f, g, surfaces, gradients, v1**2 + v2**2


replay_controls = partial(replay.replay, plant, START)


def missed(x):
    """Largest distance of a final position to the goal."""
    return float(np.abs(x[:2] - GOAL).max())


def with_nosnoc(stages=STAGES, elements=ELEMENTS, ncp=NCP, scheme='RADAU', u=None, **settings):
    """The same problem in nosnoc."""
    import casadi as ca
    import nosnoc
    from benchmarks.ocp import nosnoc_peer

    q, v, c = ca.SX.sym('q', 2), ca.SX.sym('v', 2), ca.SX.sym('u', 2)
    surfaces = [q[0] + 0.15 * q[1] ** 2, q[1] - 0.05 * q[0] ** 3]
    sides = [np.array([[1], [-1]])] * 2
    # two subsystems, whose right-hand sides add up
    first = ca.horzcat(ca.vertcat(v[0] - 1, 0, c), ca.vertcat(v[0] + 1, 0, c))
    second = ca.horzcat(ca.vertcat(0, v[1] - 1, 0, 0), ca.vertcat(0, v[1] + 1, 0, 0))
    model = nosnoc.NosnocModel(x=ca.vertcat(q, v), F=[first, second], S=sides, c=surfaces, x0=np.array(START), u=c)
    limit = np.full(2, U_MAX)
    ocp = nosnoc.NosnocOcp(lbu=-limit, ubu=limit, f_q=ca.sumsqr(v), g_terminal=q - np.array(GOAL))
    return nosnoc_peer.solve(model, ocp, nosnoc_peer.options(HORIZON, stages, elements, ncp, scheme, **settings), u)
