"""Voice-coil motor with Coulomb friction: a load on a spring is moved by 1 cm from rest to rest with least voltage.

    x1' = v1,   m1 v1' = k (x2 - x1) + K_F I - F_R sgn(v1),   x2' = v2,   m2 v2' = k (x1 - x2),   L I' = u - R I - K_S v1

|u| <= 5, T = 0.08 s, min int u^2 dt; u is constant on each of 30 stages.

Units: m, s, N, A, V.  Source: Christiansen, Maurer, Zirn (2008); problem 'motor with friction' of NOSNOC.
"""

from functools import partial

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.ocp import replay
from benchmarks.ocp.discretisation import moving_grid

HORIZON, STAGES, ELEMENTS, NCP = 0.08, 30, 2, 2
M1, M2, K, R, L, K_F, K_S, F_R = 1.03, 0.56, 2400.0, 2.0, 2e-3, 12.0, 12.0, 2.1
U_MAX = 5.0
U_RANGE, CONTROLS = (-U_MAX, U_MAX), 1
REFERENCE = 0.855622
START, GOAL = (0.0,) * 5, (0.01, 0.0, 0.01, 0.0, 0.0)


def build(stages=STAGES):
    """The model with the given number of control stages, as a user writes it."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=np.linspace(0, HORIZON, stages + 1).tolist())
    m.x1, m.v1, m.x2, m.v2, m.I = (pyo.Var(m.t, initialize=0) for _ in range(5))
    m.u = pyo.Var(m.t, initialize=0, bounds=(-U_MAX, U_MAX))
    m.dx1, m.dv1, m.dx2, m.dv2, m.dI = (dae.DerivativeVar(x, wrt=m.t) for x in (m.x1, m.v1, m.x2, m.v2, m.I))
    for x, end in zip((m.x1, m.v1, m.x2, m.v2, m.I), GOAL):
        x[0].fix(0)
        x[HORIZON].fix(end)
    m.slide = pyo.Constraint(m.t, rule=lambda m, t: m.dx1[t] == m.v1[t])
    m.follow = pyo.Constraint(m.t, rule=lambda m, t: m.dx2[t] == m.v2[t])
    m.spring = pyo.Constraint(m.t, rule=lambda m, t: M2 * m.dv2[t] == K * (m.x1[t] - m.x2[t]))
    m.coil = pyo.Constraint(m.t, rule=lambda m, t: L * m.dI[t] == m.u[t] - R * m.I[t] - K_S * m.v1[t])
    m.force = pyo.Expression(m.t, rule=lambda m, t: K * (m.x2[t] - m.x1[t]) + K_F * m.I[t])

    @m.Disjunction(m.t)
    def friction(m, t):
        return [
            [m.v1[t] >= 0, M1 * m.dv1[t] == m.force[t] - F_R],
            [m.v1[t] <= 0, M1 * m.dv1[t] == m.force[t] + F_R],
        ]

    m.effort = dae.Integral(m.t, rule=lambda m, t: m.u[t] ** 2)
    m.cost = pyo.Objective(expr=m.effort)
    return m


def discretise(m, elements=ELEMENTS, ncp=NCP, scheme='LAGRANGE-RADAU'):
    """Apply ``fesd.dcs`` and the moving grid, with ``elements`` elements in each control stage."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    return moving_grid(m, elements, ncp, scheme)


def plant(x, u):
    """For ``replay``: the friction and the rate of the cost."""
    x1, v1, x2, v2, current = x
    spring = K * (x2 - x1)
    f = np.array([v1, (spring + K_F * current) / M1, v2, -spring / M2, (u[0] - R * current - K_S * v1) / L])
    along = np.eye(5)[[1]]
    return f, -F_R / M1 * along.T, np.array([v1]), along, u[0] ** 2


replay_controls = partial(replay.replay, plant, START)


def missed(x):
    """Distance of the final positions to the goal, in mm."""
    return 1e3 * float(np.abs(x - GOAL)[[0, 2]].max())


def with_nosnoc(stages=STAGES, elements=ELEMENTS, ncp=NCP, scheme='RADAU', u=None, **settings):
    """The same problem in nosnoc."""
    import casadi as ca
    import nosnoc
    from benchmarks.ocp import nosnoc_peer

    x, c = ca.SX.sym('x', 5), ca.SX.sym('u')
    x1, v1, x2, v2, current = ca.vertsplit(x)

    def field(friction):
        force = K * (x2 - x1) + K_F * current - friction
        return ca.vertcat(v1, force / M1, v2, K * (x1 - x2) / M2, (c - R * current - K_S * v1) / L)

    model = nosnoc.NosnocModel(x=x, F=[ca.horzcat(field(F_R), field(-F_R))], S=[np.array([[1], [-1]])], c=[v1], x0=np.zeros(5), u=c)
    limit = np.full(1, U_MAX)
    ocp = nosnoc.NosnocOcp(lbu=-limit, ubu=limit, f_q=c**2, g_terminal=x - np.array(GOAL))
    return nosnoc_peer.solve(model, ocp, nosnoc_peer.options(HORIZON, stages, elements, ncp, scheme, **settings), u)
