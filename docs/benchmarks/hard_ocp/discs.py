"""Two discs in the plane change places: one is driven and pushes the other; inelastic contact without friction.

    m_1 v_1' = u - d(v_1) + 2 (q_1 - q_2) N,    m_2 v_2' = -d(v_2) + 2 (q_2 - q_1) N,    0 <= N perp |q_1 - q_2|^2 - 0.5^2 >= 0
    d(v) = 2 v/|v + (0.1, 0.1)|

m = (2, 1), from q = (-1, 0, 1, 0) at rest; |u_i| <= 20, |v_i| <= 5, T = 3, u is constant on each of 30 stages.  The goal is
(1, 0, -1, 0): min int (10 |d_1|^2 + 20 |d_2|^2 + 0.1 |u|^2) dt + 1000 (|d|^2 + |v|^2)(T).

Two forms: ``contact``, and NOSNOC's time-freezing written as a Disjunction: where the discs approach within the contact, time and
places stand still while an auxiliary force pushes the velocities apart.

Source: problem 'discs switch places' of NOSNOC.
"""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.hard_ocp import grid, replay

import pyomo_fesd

HORIZON, STAGES, ELEMENTS, NCP = 3.0, 30, 3, 1
MASSES, DRAG, SMALL, REACH = np.array([2.0, 2.0, 1.0, 1.0]), 2.0, 0.1, 0.5
START, GOAL, WEIGHTS = (-1.0, 0.0, 1.0, 0.0), (1.0, 0.0, -1.0, 0.0), (10.0, 10.0, 20.0, 20.0)
U_MAX, V_MAX, Q_MAX = 20.0, 5.0, 10.0
U_RANGE, CONTROLS = (-U_MAX, U_MAX), 2
#: Time-freezing: the auxiliary force, and the range of the speed of time.
PUSH, SPEED = 10.0, (1.0, 25.0)


def running(q, u):
    """Rate of the cost."""
    return sum(weight * (x - goal) ** 2 for weight, x, goal in zip(WEIGHTS, q, GOAL)) + 0.1 * (u[0] ** 2 + u[1] ** 2)


def final_cost(q, v):
    """Cost of the state at the end."""
    return 1000 * (sum((x - goal) ** 2 for x, goal in zip(q, GOAL)) + sum(speed**2 for speed in v))


def gap(q):
    """Squared distance of the centres less its value in contact."""
    return (q[0] - q[2]) ** 2 + (q[1] - q[3]) ** 2 - REACH**2


def normal(q):
    """Gradient of the gap."""
    return [2 * (q[0] - q[2]), 2 * (q[1] - q[3]), 2 * (q[2] - q[0]), 2 * (q[3] - q[1])]


def drags(v, sqrt):
    """Resistance of the ground against both discs."""
    sizes = [sqrt((v[k] + SMALL) ** 2 + (v[k + 1] + SMALL) ** 2) for k in (0, 2)]
    return [DRAG * v[k] / sizes[k // 2] for k in range(4)]


def build(form='contact', **options):
    """The transformed model in one of ``FORMS``; ``options`` are those of the form and of ``fesd.finite_elements``."""
    return FORMS[form](**options)


def _bodies():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=grid.ends(HORIZON, STAGES))
    m.i, m.j = pyo.RangeSet(4), pyo.RangeSet(2)
    m.q = pyo.Var(m.i, m.t, initialize=lambda m, i, t: START[i - 1], bounds=(-Q_MAX, Q_MAX))
    m.v = pyo.Var(m.i, m.t, initialize=0, bounds=(-V_MAX, V_MAX))
    m.u = pyo.Var(m.j, m.t, initialize=0, bounds=(-U_MAX, U_MAX))
    m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    m.q[:, 0].fix()
    m.v[:, 0].fix()
    return m


def _at(m, t):
    """q, v, u."""
    return [m.q[i, t] for i in m.i], [m.v[i, t] for i in m.i], [m.u[j, t] for j in m.j]


def _force(m, i, t):
    """Drive and drag of coordinate i."""
    _, v, u = _at(m, t)
    return (u[i - 1] if i < 3 else 0) - drags(v, pyo.sqrt)[i - 1]


def _with_contact(elements=ELEMENTS, ncp=NCP, **options):
    m = _bodies()
    m.touch = pyomo_fesd.contact(m.t, gap=lambda m, t: gap(_at(m, t)[0]))
    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.v[i, t])

    @m.Constraint(m.i, m.t)
    def momentum(m, i, t):
        return MASSES[i - 1] * m.dv[i, t] == _force(m, i, t) + normal(_at(m, t)[0])[i - 1] * m.touch[t].normal

    m.track = dae.Integral(m.t, rule=lambda m, t: running(_at(m, t)[0], _at(m, t)[2]))
    m.cost = pyo.Objective(expr=m.track + final_cost(*_at(m, HORIZON)[:2]))
    return grid.moving_grid(m, elements, [m.u], ncp=ncp, **options)


def _with_frozen_time(elements=ELEMENTS, ncp=NCP, clock='speed', **options):
    m = _bodies()
    clocked = grid.clock(m, clock, HORIZON / STAGES, SPEED)
    m.time, m.frozen = pyo.Var(m.t, initialize=lambda m, t: t), pyo.Var(m.t, initialize=0)
    m.dtime = dae.DerivativeVar(m.time, wrt=m.t)
    m.time[0].fix(0)

    @m.Disjunction(m.t)
    def contact(m, t):
        q, v, _ = _at(m, t)
        apart = sum(n * speed for n, speed in zip(normal(q), v))
        return [
            [gap(q) >= 0, m.frozen[t] == 0],
            [gap(q) <= 0, apart >= 0, m.frozen[t] == 0],
            [gap(q) <= 0, apart <= 0, m.frozen[t] == 1],
        ]

    m.runs = pyo.Expression(m.t, rule=lambda m, t: (1 - m.frozen[t]) * m.speed[t])
    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.runs[t] * m.v[i, t])

    @m.Constraint(m.i, m.t)
    def momentum(m, i, t):
        push = PUSH * m.frozen[t] * normal(_at(m, t)[0])[i - 1]
        return MASSES[i - 1] * m.dv[i, t] == m.runs[t] * _force(m, i, t) + push

    m.tick = pyo.Constraint(m.t, rule=lambda m, t: m.dtime[t] == m.runs[t])
    m.stage_ends = pyo.Constraint(grid.ends(HORIZON, STAGES)[1:], rule=lambda m, t: m.time[t] == t)
    m.track = dae.Integral(m.t, rule=lambda m, t: m.runs[t] * running(_at(m, t)[0], _at(m, t)[2]))
    m.cost = pyo.Objective(expr=m.track + final_cost(*_at(m, HORIZON)[:2]))
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    return grid.moving_grid(m, elements, [m.u], ncp=ncp, **clocked, **options)


#: The forms of the model.
FORMS = {'contact': _with_contact, 'time_freezing': _with_frozen_time}


def controls(m):
    """Controls of each stage: (stages, 2)."""
    return np.array([[m.u[j, t].value for j in m.j] for t in grid.ends(HORIZON, STAGES)[1:]])


PLANT = replay.Plant(
    mass=MASSES,
    force=lambda q, v, u: np.array([*u, 0.0, 0.0]) - np.array(drags(v, np.sqrt)),
    gap=lambda q: np.array([gap(q)]),
    normal=lambda q: np.array([normal(q)]),
    rate=lambda q, v, u, stage: running(q, u),
)
AT_START = (START, (0.0,) * 4)

#: Bounds of positions and velocities.
BOUNDS = (np.full(4, -Q_MAX), np.full(4, Q_MAX), np.full(4, V_MAX))


def missed(outcome):
    """Nothing is asked for beyond the cost."""
    return 0.0


def twin():
    """The same problem in nosnoc, with the settings of its own example."""
    import casadi as ca
    from benchmarks.hard_ocp import nosnoc_peer

    q, v, t, u, speed = nosnoc_peer.symbols(4, 2)
    alpha, free, frozen = ca.SX.sym('alpha', 2), ca.SX.sym('free'), ca.SX.sym('frozen')
    q_, v_, u_ = (ca.vertsplit(part) for part in (q, v, u))
    n, inverse = ca.vertcat(*normal(q_)), ca.diag(1 / MASSES)
    force = ca.vertcat(u, 0, 0) - ca.vertcat(*drags(v_, ca.sqrt))
    flight = speed * ca.vertcat(v, inverse @ force, 1)
    push = ca.vertcat(ca.SX.zeros(4), PUSH * inverse @ n, 0)
    given = {
        'x': ca.vertcat(q, v, t),
        'u': ca.vertcat(u, speed),
        't_var': t,
        'alpha': [alpha],
        'c': [ca.vertcat(gap(q_), ca.dot(n, v))],
        'f_x': [free * flight + frozen * push],
        'z': ca.vertcat(free, frozen),
        'z0': np.ones(2),
        'g_z': ca.vertcat(free - (alpha[0] + alpha[1] - alpha[0] * alpha[1]), frozen - (1 - alpha[0]) * (1 - alpha[1])),
    }
    reach = np.repeat([Q_MAX, V_MAX], 4)
    costs = {'f_q': speed * running(q_, u_), 'f_terminal': final_cost(q_, v_)}
    return nosnoc_peer.Twin(given, (-reach, reach, SPEED), costs, {'max_iter_homotopy': 7}, {'max_iter': 1000})
