"""Cart and pole with Coulomb friction on the cart: the pole swings up from rest and is held.

    M(theta) (v', w') = (u - F sgn(v) + m2 l w^2 sin(theta), -m2 g l sin(theta)),   M = [[m1 + m2, m2 l cos], [m2 l cos, m2 l^2]]

F = 2, m1 = 1, m2 = 0.1, l = 1, |u| <= 30, |x| <= 5, T = 5, from (x, theta, v, w) = (1, 0, 0, 0).  The distance to (0, pi, 0, 0)
costs: min int (10 x^2 + 100 (theta - pi)^2 + v^2 + w^2 + u^2) dt + (500 x^2 + 100 (theta - pi)^2 + 10 v^2 + 10 w^2)(T).
u is constant on each of 20 stages.

Source: problem 'cart pole with friction' of NOSNOC.
"""

from math import pi

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.ocp import replay
from benchmarks.ocp.discretisation import moving_grid

HORIZON, STAGES, ELEMENTS, NCP = 5.0, 20, 2, 2
F, M1, M2, LENGTH, G = 2.0, 1.0, 0.1, 1.0, 9.81
START, GOAL = (1.0, 0.0, 0.0, 0.0), (0.0, pi, 0.0, 0.0)
U_MAX, X_MAX = 30.0, 5.0
U_RANGE, CONTROLS = (-U_MAX, U_MAX), 1
REFERENCE = 677.4705
RUNNING, FINAL = (10.0, 100.0, 1.0, 1.0), (500.0, 100.0, 10.0, 10.0)


def distance(weights, state):
    """The squared distance to the goal."""
    return sum(weight * (x - goal) ** 2 for weight, x, goal in zip(weights, state, GOAL))


def build(stages=STAGES):
    """The model with the given number of control stages, as a user writes it."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=np.linspace(0, HORIZON, stages + 1).tolist())
    m.x, m.theta = pyo.Var(m.t, initialize=START[0], bounds=(-X_MAX, X_MAX)), pyo.Var(m.t, initialize=START[1])
    m.v, m.w = pyo.Var(m.t, initialize=START[2]), pyo.Var(m.t, initialize=START[3])
    m.u, m.friction = pyo.Var(m.t, initialize=0, bounds=(-U_MAX, U_MAX)), pyo.Var(m.t, initialize=0)
    m.dx, m.dtheta, m.dv, m.dw = (dae.DerivativeVar(x, wrt=m.t) for x in (m.x, m.theta, m.v, m.w))
    for x, start in zip((m.x, m.theta, m.v, m.w), START):
        x[0].fix(start)
    m.place = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])
    m.angle = pyo.Constraint(m.t, rule=lambda m, t: m.dtheta[t] == m.w[t])

    @m.Constraint(m.t)
    def cart(m, t):
        swing = M2 * LENGTH * (m.dw[t] * pyo.cos(m.theta[t]) - m.w[t] ** 2 * pyo.sin(m.theta[t]))
        return (M1 + M2) * m.dv[t] + swing == m.u[t] - m.friction[t]

    @m.Constraint(m.t)
    def pole(m, t):
        return m.dv[t] * pyo.cos(m.theta[t]) + LENGTH * m.dw[t] == -G * pyo.sin(m.theta[t])

    @m.Disjunction(m.t)
    def dry(m, t):
        return [[m.v[t] >= 0, m.friction[t] == F], [m.v[t] <= 0, m.friction[t] == -F]]

    m.effort = dae.Integral(m.t, rule=lambda m, t: distance(RUNNING, (m.x[t], m.theta[t], m.v[t], m.w[t])) + m.u[t] ** 2)
    end = (m.x[HORIZON], m.theta[HORIZON], m.v[HORIZON], m.w[HORIZON])
    m.cost = pyo.Objective(expr=m.effort + distance(FINAL, end))
    return m


def discretise(m, elements=ELEMENTS, ncp=NCP, scheme='LAGRANGE-RADAU'):
    """Apply ``fesd.dcs`` and the moving grid, with ``elements`` elements in each control stage."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    return moving_grid(m, elements, ncp, scheme)


def plant(x, u):
    """For ``replay``: the friction and the rate of the cost."""
    _, theta, v, w = x
    coupling = M2 * LENGTH * np.cos(theta)
    accelerations = np.linalg.inv([[M1 + M2, coupling], [coupling, M2 * LENGTH**2]])
    forces = np.array([u[0] + M2 * LENGTH * w**2 * np.sin(theta), -M2 * G * LENGTH * np.sin(theta)])
    f = np.array([v, w, *accelerations @ forces])
    g = np.array([0, 0, *-F * accelerations[:, 0]])[:, np.newaxis]
    return f, g, np.array([v]), np.eye(4)[[2]], distance(RUNNING, x) + u[0] ** 2


def replay_controls(controls, lengths):
    """State at the end of these controls, and their true cost."""
    end, running = replay.replay(plant, START, controls, lengths)
    return end, running + distance(FINAL, end)


def missed(x):
    """Distance of the final place and angle to the goal, which the cost weighs."""
    return float(np.abs(x - GOAL)[:2].max())


def with_nosnoc(stages=STAGES, elements=ELEMENTS, ncp=NCP, scheme='RADAU', u=None, **settings):
    """The same problem in nosnoc."""
    import casadi as ca
    import nosnoc
    from benchmarks.ocp import nosnoc_peer

    x, c = ca.SX.sym('x', 4), ca.SX.sym('u')
    _, theta, v, w = ca.vertsplit(x)
    coupling = M2 * LENGTH * ca.cos(theta)
    inertia = ca.vertcat(ca.horzcat(M1 + M2, coupling), ca.horzcat(coupling, M2 * LENGTH**2))

    def field(friction):
        forces = ca.vertcat(c - friction + M2 * LENGTH * w**2 * ca.sin(theta), -M2 * G * LENGTH * ca.sin(theta))
        return ca.vertcat(v, w, ca.inv(inertia) @ forces)

    model = nosnoc.NosnocModel(x=x, F=[ca.horzcat(field(F), field(-F))], S=[np.array([[1], [-1]])], c=[v], x0=np.array(START), u=c)
    limit, reach = np.full(1, U_MAX), np.array([X_MAX, np.inf, np.inf, np.inf])
    state = ca.vertsplit(x)
    ocp = nosnoc.NosnocOcp(
        lbu=-limit, ubu=limit, lbx=-reach, ubx=reach, f_q=distance(RUNNING, state) + c**2, f_terminal=distance(FINAL, state)
    )
    return nosnoc_peer.solve(model, ocp, nosnoc_peer.options(HORIZON, stages, elements, ncp, scheme, **settings), u)
