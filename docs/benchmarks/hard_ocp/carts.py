"""Three carts on a rail: the middle one is driven and pushes the outer ones apart by 2 each; inelastic contacts.

    v_1' = -2 v_1 - N_1,    v_2' = -2 v_2 + u + N_1 - N_2,    v_3' = -2 v_3 + N_2,    0 <= N_c perp q_{c+1} - q_c - 2 >= 0

From q = (-3, 0, 3) at rest; |u| <= 20, |v| <= 5, T = 5, u is constant on each of 20 stages.  The distance to (-5, 0, 5) at rest
costs: min int (w(q, v) + 0.1 u^2) dt + 100 w(q, v)(T), w = 10 d_1^2 + d_2^2 + 10 d_3^2 + 0.1 |v|^2.

Source: problem 'three carts' of NOSNOC.
"""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.hard_ocp import grid, replay

import pyomo_fesd

HORIZON, STAGES, ELEMENTS, NCP = 5.0, 20, 3, 2
LENGTH, DRAG = 2.0, 2.0
START, GOAL, WEIGHTS = (-3.0, 0.0, 3.0), (-5.0, 0.0, 5.0), (10.0, 1.0, 10.0)
LOWEST, HIGHEST = (-15.0, -15.0, -10.0), (10.0, 15.0, 15.0)
U_MAX, V_MAX = 20.0, 5.0
U_RANGE, CONTROLS = (-U_MAX, U_MAX), 1
#: Time-freezing in nosnoc: the auxiliary force, and the range of the speed of time.
PUSH, SPEED = 100.0, (1.0, 25.0)


def distance(q, v):
    """w: the weighted squared distance to the goal at rest."""
    return sum(weight * (x - goal) ** 2 for weight, x, goal in zip(WEIGHTS, q, GOAL)) + 0.1 * sum(speed**2 for speed in v)


def build(form='contact', **options):
    """The transformed model in one of ``FORMS``; ``options`` are those of the form and of ``fesd.finite_elements``."""
    return FORMS[form](**options)


def _with_contact(elements=ELEMENTS, ncp=NCP, **options):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=grid.ends(HORIZON, STAGES))
    m.i, m.c = pyo.RangeSet(3), pyo.RangeSet(2)
    m.q = pyo.Var(m.i, m.t, initialize=lambda m, i, t: START[i - 1], bounds=lambda m, i, t: (LOWEST[i - 1], HIGHEST[i - 1]))
    m.v = pyo.Var(m.i, m.t, initialize=0, bounds=(-V_MAX, V_MAX))
    m.u = pyo.Var(m.t, initialize=0, bounds=(-U_MAX, U_MAX))
    m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    m.q[:, 0].fix()
    m.v[:, 0].fix()
    m.buffer = pyomo_fesd.contact(m.c, m.t, gap=lambda m, c, t: m.q[c + 1, t] - m.q[c, t] - LENGTH)
    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.v[i, t])

    @m.Constraint(m.i, m.t)
    def momentum(m, i, t):
        left = m.buffer[i - 1, t].normal if i > 1 else 0
        right = m.buffer[i, t].normal if i < 3 else 0
        return m.dv[i, t] == -DRAG * m.v[i, t] + (m.u[t] if i == 2 else 0) + left - right

    m.track = dae.Integral(m.t, rule=lambda m, t: distance(*_state(m, t)) + 0.1 * m.u[t] ** 2)
    m.cost = pyo.Objective(expr=m.track + 100 * distance(*_state(m, HORIZON)))
    return grid.moving_grid(m, elements, [m.u], ncp=ncp, **options)


def _state(m, t):
    return [m.q[i, t] for i in m.i], [m.v[i, t] for i in m.i]


#: The forms of the model.
FORMS = {'contact': _with_contact}


def controls(m):
    """Controls of each stage: (stages, 1)."""
    return np.array([[m.u[t].value] for t in grid.ends(HORIZON, STAGES)[1:]])


PLANT = replay.Plant(
    mass=np.ones(3),
    force=lambda q, v, u: np.array([0.0, u[0], 0.0]) - DRAG * v,
    gap=lambda q: np.array([q[1] - q[0] - LENGTH, q[2] - q[1] - LENGTH]),
    normal=lambda q: np.array([[-1, 1, 0], [0, -1, 1]]) + 0 * q[0],
    rate=lambda q, v, u, stage: distance(q, v) + 0.1 * u[0] ** 2,
)
AT_START = (START, (0.0,) * 3)
#: Bounds of positions and velocities.
BOUNDS = (LOWEST, HIGHEST, V_MAX)


def final_cost(q, v):
    """Cost of the state at the end."""
    return 100 * distance(q, v)


def missed(outcome):
    """Nothing is asked for beyond the cost."""
    return 0.0


def twin():
    """The same problem in nosnoc, after its multi-contact time-freezing: each contact has an auxiliary force."""
    import casadi as ca
    from benchmarks.hard_ocp import nosnoc_peer

    q, v, t, u, speed = nosnoc_peer.symbols(3, 1)
    alpha, free, frozen = ca.SX.sym('alpha', 4), ca.SX.sym('free'), ca.SX.sym('frozen', 2)
    normal = ca.DM([[-1, 1, 0], [0, -1, 1]])
    closed = [(1 - alpha[k]) * (1 - alpha[k + 2]) for k in range(2)]
    flight = speed * ca.vertcat(v, ca.vertcat(0, u, 0) - DRAG * v, 1)
    pushes = [ca.vertcat(ca.SX.zeros(3), PUSH * normal[k, :].T, 0) for k in range(2)]
    given = {
        'x': ca.vertcat(q, v, t),
        'u': ca.vertcat(u, speed),
        't_var': t,
        'alpha': [alpha],
        'c': [ca.vertcat(normal @ q - LENGTH, normal @ v)],
        'f_x': [free * flight + frozen[0] * pushes[0] + frozen[1] * pushes[1]],
        'z': ca.vertcat(free, frozen),
        'z0': np.ones(3),
        'g_z': ca.vertcat(free - (1 - closed[0]) * (1 - closed[1]), frozen - ca.vertcat(*closed)),
    }
    q_, v_ = ca.vertsplit(q), ca.vertsplit(v)
    costs = {'f_q': speed * (distance(q_, v_) + 0.1 * u**2), 'f_terminal': final_cost(q_, v_)}
    fast = np.full(3, V_MAX)
    return nosnoc_peer.Twin(given, ([*LOWEST, *-fast], [*HIGHEST, *fast], SPEED), costs, ipopt={'max_iter': 1000})
