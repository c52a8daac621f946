"""Optimal control of the gas-liquid tank: the valve that lets liquid or gas out, as close to u = 0.1 as possible.

Above the outlet (M_L/rho_L > V_s) liquid leaves, below it gas does:

    liquid:  M_G' = F_G,  M_L' = F_L - L,      gas:  M_G' = F_G - G,  M_L' = F_L,      L = G = u (P - 1)

0 <= u <= 0.15, T = 25 s, min int 100 (u - 0.1)^2 dt + M_L(25): the level slides on the outlet from 9.37 s on, so u = 0.1 is best
and the least cost is 250 exactly.  u is constant on each of 5 stages.

Units: mol, s, L, K, atm.  Source: the paper.
"""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.ocp import replay
from benchmarks.ocp.discretisation import moving_grid

HORIZON, STAGES, ELEMENTS, NCP = 25.0, 5, 5, 3
F_L, F_G, V, V_S, R, T, RHO_L = 2.5, 0.1, 10.0, 5.0, 0.0820573661, 300.0, 50.0
START = (6.824494, 260.0)
U_MAX, U_START, U_BEST = 0.15, 0.05, 0.1
U_RANGE, CONTROLS = (0.0, U_MAX), 1
REFERENCE = 250.0


def build(stages=STAGES):
    """The model with the given number of control stages, as a user writes it."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=np.linspace(0, HORIZON, stages + 1).tolist())
    m.G, m.L = pyo.Var(m.t, initialize=START[0]), pyo.Var(m.t, initialize=START[1])
    m.P, m.out = pyo.Var(m.t, initialize=35), pyo.Var(m.t, initialize=0)
    m.u = pyo.Var(m.t, initialize=U_START, bounds=(0, U_MAX))
    m.dG, m.dL = dae.DerivativeVar(m.G), dae.DerivativeVar(m.L)
    m.G[0].fix(START[0])
    m.L[0].fix(START[1])
    m.pressure = pyo.Constraint(m.t, rule=lambda m, t: m.P[t] * (V - m.L[t] / RHO_L) == m.G[t] * R * T)
    m.valve = pyo.Constraint(m.t, rule=lambda m, t: m.out[t] == m.u[t] * (m.P[t] - 1))

    @m.Disjunction(m.t)
    def outlet(m, t):
        return [
            [m.L[t] / RHO_L >= V_S, m.dG[t] == F_G, m.dL[t] == F_L - m.out[t]],
            [m.L[t] / RHO_L <= V_S, m.dG[t] == F_G - m.out[t], m.dL[t] == F_L],
        ]

    m.effort = dae.Integral(m.t, rule=lambda m, t: 100 * (m.u[t] - U_BEST) ** 2)
    m.cost = pyo.Objective(expr=m.effort + m.L[HORIZON])
    return m


def discretise(m, elements=ELEMENTS, ncp=NCP, scheme='LAGRANGE-RADAU'):
    """Apply ``fesd.dcs`` and the moving grid, with ``elements`` elements in each control stage."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    return moving_grid(m, elements, ncp, scheme)


def plant(x, u):
    """For ``replay``: the outlet and the rate of the cost."""
    gas, liquid = x
    half = u[0] * (gas * R * T / (V - liquid / RHO_L) - 1) / 2
    f, g = np.array([F_G - half, F_L - half]), np.array([[half], [-half]])
    return f, g, np.array([liquid / RHO_L - V_S]), np.array([[0, 1 / RHO_L]]), 100 * (u[0] - U_BEST) ** 2


def replay_controls(controls, lengths):
    """State at the end of these controls, and their true cost."""
    end, running = replay.replay(plant, START, controls, lengths)
    return end, running + end[1]


#: The tank has no goal beyond its cost.
missed = None


def with_nosnoc(stages=STAGES, elements=ELEMENTS, ncp=NCP, scheme='RADAU', u=None, **settings):
    """The same problem in nosnoc, with the pressure eliminated."""
    import casadi as ca
    import nosnoc
    from benchmarks.ocp import nosnoc_peer

    gas, liquid, c = ca.SX.sym('M_G'), ca.SX.sym('M_L'), ca.SX.sym('u')
    out = c * (gas * R * T / (V - liquid / RHO_L) - 1)
    modes = ca.horzcat(ca.vertcat(F_G, F_L - out), ca.vertcat(F_G - out, F_L))
    model = nosnoc.NosnocModel(
        x=ca.vertcat(gas, liquid), F=[modes], S=[np.array([[1], [-1]])], c=[liquid / RHO_L - V_S], x0=np.array(START), u=c
    )
    ocp = nosnoc.NosnocOcp(
        lbu=np.zeros(1), ubu=np.full(1, U_MAX), u_guess=np.full(1, U_START), f_q=100 * (c - U_BEST) ** 2, f_terminal=liquid
    )
    return nosnoc_peer.solve(model, ocp, nosnoc_peer.options(HORIZON, stages, elements, ncp, scheme, **settings), u)
