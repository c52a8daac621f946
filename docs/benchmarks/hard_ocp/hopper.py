"""A hopper on one leg jumps 0.8 m: body and foot, contact with Coulomb friction, and the foot may not slip.

    M = diag(1.1, 1.1, 0.275, 0.1) in q = (x, y, angle, leg);   M v' = B(q) u - (0, 1.1 g, 0, 0) + n N + t F
    gap = y - leg cos(angle),   slip = t^T v,   t = (1, 0, leg cos(angle), sin(angle)),   |F| <= 0.45 N,   N slip = 0

From (0.1, 0.5, 0, 0.5) at rest; |u_i| <= 50, |v| <= (10, 10, 5, 5), T = 1, u is constant on each of 20 stages.  The distance to a
reference in each stage (a spline through a jump) costs, and at the end that to (0.9, 0.5, 0, 0.5) at rest.

Two forms: ``contact``, and NOSNOC's time-freezing written as a Disjunction with two auxiliary forces, on the edges of the cone.

Source: problem 'hopper, one step' of NOSNOC, after Howell and others.
"""

from math import pi

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.hard_ocp import grid, replay
from pyomo.mpec import Complementarity, complements
from scipy.interpolate import CubicSpline

import pyomo_fesd

HORIZON, STAGES, ELEMENTS, NCP = 1.0, 20, 2, 2
G, FRICTION, DISTANCE, HEIGHT = 9.81, 0.45, 0.8, 0.75
MASSES = np.array([1.1, 1.1, 0.275, 0.1])
START, GOAL = (0.1, 0.5, 0.0, 0.5), (0.1 + DISTANCE, 0.5, 0.0, 0.5)
LOWEST, HIGHEST, V_MAX = (0.0, 0.0, -pi, 0.1), (0.2 + DISTANCE, 1.5, pi, 0.5), (10.0, 10.0, 5.0, 5.0)
U_MAX = 50.0
U_RANGE, CONTROLS = (-U_MAX, U_MAX), 2
WEIGHTS, FINAL, SLOWNESS, EFFORT = (100.0, 100.0, 20.0, 50.0), 300.0, 0.1, 0.01
#: Time-freezing: the auxiliary force, and the range of the speed of time.
PUSH, SPEED = 100.0, (0.1, 20.0)


def reference():
    """Positions of the spline at the ends of the stages, the start among them: (stages + 1, 4)."""
    middle = (0.1 + DISTANCE / 2, HEIGHT, 0.0, 0.1)
    return CubicSpline([0, 0.5, 1], [START, middle, GOAL])(np.linspace(0, 1, STAGES + 1))


def running(q, v, u, wanted):
    """Rate of the cost."""
    track = sum(weight * (x - r) ** 2 for weight, x, r in zip(WEIGHTS, q, wanted))
    return track + SLOWNESS * sum(speed**2 for speed in v) + EFFORT * (u[0] ** 2 + u[1] ** 2)


def final_cost(q, v):
    """Cost of the state at the end."""
    return FINAL * sum((x - goal) ** 2 for x, goal in zip(q, GOAL)) + SLOWNESS * sum(speed**2 for speed in v)


def gap(q, f):
    """Height of the foot; ``f`` is the module with sin and cos."""
    return q[1] - q[3] * f.cos(q[2])


def normal(q, f):
    """Gradient of the gap."""
    return [0, 1, q[3] * f.sin(q[2]), -f.cos(q[2])]


def tangent(q, f):
    """Velocity of the foot along the ground by the velocities."""
    return [1, 0, q[3] * f.cos(q[2]), f.sin(q[2])]


def drive(q, u, f):
    """Forces of the motors and the weight."""
    return [-f.sin(q[2]) * u[1], f.cos(q[2]) * u[1] - MASSES[1] * G, u[0], u[1]]


def build(form='contact', **options):
    """The transformed model in one of ``FORMS``; ``options`` are those of the form and of ``fesd.finite_elements``."""
    return FORMS[form](**options)


def _bodies(guess):
    """``guess`` of the positions: 'start', or 'reference'."""
    m = pyo.ConcreteModel()
    times, points = grid.ends(HORIZON, STAGES), reference()
    m.t = dae.ContinuousSet(initialize=times)
    m.i, m.j = pyo.RangeSet(4), pyo.RangeSet(2)

    def place(m, i, t):
        return START[i - 1] if guess == 'start' else points[round(t * STAGES / HORIZON), i - 1]

    m.q = pyo.Var(m.i, m.t, initialize=place, bounds=lambda m, i, t: (LOWEST[i - 1], HIGHEST[i - 1]))
    m.v = pyo.Var(m.i, m.t, initialize=0, bounds=lambda m, i, t: (-V_MAX[i - 1], V_MAX[i - 1]))
    m.u = pyo.Var(m.j, m.t, initialize=0, bounds=(-U_MAX, U_MAX))
    wanted = {(i, t): float(point[i - 1]) for t, point in zip(times[1:], points[1:]) for i in m.i}
    m.wanted = pyo.Param(m.i, m.t, mutable=True, initialize=wanted)
    m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    for i in m.i:
        m.q[i, 0].fix(START[i - 1])
        m.v[i, 0].fix(0)
    return m


def _at(m, t):
    """q, v, u."""
    return [m.q[i, t] for i in m.i], [m.v[i, t] for i in m.i], [m.u[j, t] for j in m.j]


def _dot(direction, v):
    return sum(d * speed for d, speed in zip(direction, v))


def _slip(m, t):
    q, v, _ = _at(m, t)
    return _dot(tangent(q, pyo), v)


def _no_slip(m, force):
    """0 <= force perp |slip|: slip = forth - back, each of which is zero where the force is not.

    (One variable that two inequalities keep above |slip| states the same, but where it is zero these have no interior.)
    """
    m.forth, m.back = pyo.Var(m.t, initialize=0, bounds=(0, None)), pyo.Var(m.t, initialize=0, bounds=(0, None))
    m.parts = pyo.Constraint(m.t, rule=lambda m, t: _slip(m, t) == m.forth[t] - m.back[t])
    m.no_slip_forth = Complementarity(m.t, rule=lambda m, t: complements(force(m, t) >= 0, m.forth[t] >= 0))
    m.no_slip_back = Complementarity(m.t, rule=lambda m, t: complements(force(m, t) >= 0, m.back[t] >= 0))


def _with_contact(elements=ELEMENTS, ncp=NCP, no_slip=True, guess='start', **options):
    """``no_slip`` False leaves out the condition on the foot; Coulomb's law remains."""
    m = _bodies(guess)
    m.ground = pyomo_fesd.contact(m.t, gap=lambda m, t: gap(_at(m, t)[0], pyo), friction=FRICTION, slip=_slip, sticks=no_slip)
    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.v[i, t])

    @m.Constraint(m.i, m.t)
    def momentum(m, i, t):
        q, _, u = _at(m, t)
        reaction = normal(q, pyo)[i - 1] * m.ground[t].normal + tangent(q, pyo)[i - 1] * m.ground[t].friction
        return MASSES[i - 1] * m.dv[i, t] == drive(q, u, pyo)[i - 1] + reaction

    m.track = dae.Integral(m.t, rule=lambda m, t: running(*_at(m, t), [m.wanted[i, t] for i in m.i]))
    m.cost = pyo.Objective(expr=m.track + final_cost(*_at(m, HORIZON)[:2]))
    return grid.moving_grid(m, elements, [m.u, m.wanted], ncp=ncp, **options)


def _with_frozen_time(elements=ELEMENTS, ncp=NCP, clock='speed', guess='start', **options):
    m = _bodies(guess)
    clocked = grid.clock(m, clock, HORIZON / STAGES, SPEED)
    m.time = pyo.Var(m.t, initialize=lambda m, t: t)
    m.dtime = dae.DerivativeVar(m.time, wrt=m.t)
    m.time[0].fix(0)
    m.forward, m.backward = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)

    @m.Disjunction(m.t)
    def contact(m, t):
        q, v, _ = _at(m, t)
        height, apart, slip = gap(q, pyo), _dot(normal(q, pyo), v), _slip(m, t)
        free = [m.forward[t] == 0, m.backward[t] == 0]
        return [
            [height >= 0, *free],
            [height <= 0, apart >= 0, *free],
            [height <= 0, apart <= 0, slip >= 0, m.forward[t] == 1, m.backward[t] == 0],
            [height <= 0, apart <= 0, slip <= 0, m.forward[t] == 0, m.backward[t] == 1],
        ]

    m.runs = pyo.Expression(m.t, rule=lambda m, t: (1 - m.forward[t] - m.backward[t]) * m.speed[t])
    _no_slip(m, lambda m, t: m.forward[t] + m.backward[t])
    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.runs[t] * m.v[i, t])

    @m.Constraint(m.i, m.t)
    def momentum(m, i, t):
        q, _, u = _at(m, t)
        n, tan = normal(q, pyo)[i - 1], tangent(q, pyo)[i - 1]
        push = m.forward[t] * (n - FRICTION * tan) + m.backward[t] * (n + FRICTION * tan)
        return MASSES[i - 1] * m.dv[i, t] == m.runs[t] * drive(q, u, pyo)[i - 1] + PUSH * push

    m.tick = pyo.Constraint(m.t, rule=lambda m, t: m.dtime[t] == m.runs[t])
    m.stage_ends = pyo.Constraint(grid.ends(HORIZON, STAGES)[1:], rule=lambda m, t: m.time[t] == t)
    m.track = dae.Integral(m.t, rule=lambda m, t: m.runs[t] * running(*_at(m, t), [m.wanted[i, t] for i in m.i]))
    m.cost = pyo.Objective(expr=m.track + final_cost(*_at(m, HORIZON)[:2]))
    pyo.TransformationFactory('fesd.dcs').apply_to(m, form='heaviside')
    return grid.moving_grid(m, elements, [m.u, m.wanted], continuous=[m.forth, m.back], ncp=ncp, **clocked, **options)


#: The forms of the model.
FORMS = {'contact': _with_contact, 'time_freezing': _with_frozen_time}


def controls(m):
    """Controls of each stage: (stages, 2)."""
    return np.array([[m.u[j, t].value for j in m.j] for t in grid.ends(HORIZON, STAGES)[1:]])


def _rows(rule, q):
    return np.array([[part + 0 * q[0] for part in rule(q, np)]])


WANTED = reference()[1:]
PLANT = replay.Plant(
    mass=MASSES,
    force=lambda q, v, u: np.array(drive(q, u, np)),
    gap=lambda q: np.array([gap(q, np)]),
    normal=lambda q: _rows(normal, q),
    tangent=lambda q: _rows(tangent, q),
    rate=lambda q, v, u, stage: running(q, v, u, WANTED[stage]),
    friction=FRICTION,
)
AT_START = (START, (0.0,) * 4)
#: Bounds of positions and velocities.
BOUNDS = (LOWEST, HIGHEST, V_MAX)


def missed(outcome):
    """The way that the foot has slipped."""
    return outcome.slipped


def twin():
    """The same problem in nosnoc, with the settings of its own example."""
    import casadi as ca
    from benchmarks.hard_ocp import nosnoc_peer

    q, v, t, u, speed = nosnoc_peer.symbols(4, 2)
    alpha, free, forward, backward = ca.SX.sym('alpha', 3), *(ca.SX.sym(name) for name in ('free', 'forward', 'backward'))
    q_, v_, u_ = (ca.vertsplit(part) for part in (q, v, u))
    n, tan, inverse = ca.vertcat(*normal(q_, ca)), ca.vertcat(*tangent(q_, ca)), ca.diag(1 / MASSES)
    flight = speed * ca.vertcat(v, inverse @ ca.vertcat(*drive(q_, u_, ca)), 1)
    pushes = [ca.vertcat(ca.SX.zeros(4), PUSH * inverse @ (n + side * FRICTION * tan), 0) for side in (-1, 1)]
    closed = (1 - alpha[0]) * (1 - alpha[1])
    slip, wanted = ca.dot(tan, v), ca.SX.sym('wanted', 4)
    given = {
        'x': ca.vertcat(q, v, t),
        'u': ca.vertcat(u, speed),
        't_var': t,
        'alpha': [alpha],
        'c': [ca.vertcat(gap(q_, ca), ca.dot(n, v), slip)],
        'f_x': [free * flight + forward * pushes[0] + backward * pushes[1]],
        'z': ca.vertcat(free, forward, backward),
        'z0': np.ones(3),
        'g_z': ca.vertcat(free - (1 - closed), forward - closed * alpha[2], backward - closed * (1 - alpha[2])),
        'p_time_var': wanted,
        'p_time_var_val': WANTED,
    }
    costs = {
        'f_q': speed * running(q_, v_, u_, ca.vertsplit(wanted)),
        'f_terminal': final_cost(q_, v_),
        'g_path_comp': ca.horzcat(ca.vertcat(slip, -slip), ca.vertcat(forward + backward, forward + backward)),
    }
    bounds = ([*LOWEST, *(-np.array(V_MAX))], [*HIGHEST, *V_MAX], SPEED)
    settings = {'comp_tol': 1e-3, 'sigma_0': 10.0, 'max_iter_homotopy': 6}
    ipopt = {'max_iter': 1000, 'acceptable_tol': 1e-5, 'acceptable_iter': 3, 'tol': 1e-5}
    return nosnoc_peer.Twin(given, bounds, costs, settings, ipopt)
