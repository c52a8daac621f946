"""Rigid bodies in contact with exact answers: a ball, a row of blocks, discs, a block on an incline, a bead in a bowl."""

from math import cos, sin

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from problems.states import over_time
from scipy.integrate import solve_ivp

import pyomo_fesd

G = 10.0


def ball(e, end=1.0, height=0.8, speed=0.0):
    """A ball above a table."""
    m = over_time(end, q=height, v=speed)
    m.table = pyomo_fesd.contact(m.t, gap=lambda m, t: m.q[t], restitution=e)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.momentum = pyo.Constraint(m.t, rule=lambda m, t: 2 * m.dv[t] == -2 * G + m.table[t].normal)
    return m


def blocks(e, places=(0, 2, 4), speeds=(1, 0, 0), end=3.0):
    """Three blocks of length 1 in a row, without friction."""
    m = pyo.ConcreteModel()
    m.t, m.i, m.c = dae.ContinuousSet(bounds=(0, end)), pyo.RangeSet(3), pyo.RangeSet(2)
    m.x = pyo.Var(m.i, m.t, initialize=lambda m, i, t: places[i - 1])
    m.v = pyo.Var(m.i, m.t, initialize=lambda m, i, t: speeds[i - 1])
    m.dx, m.dv = dae.DerivativeVar(m.x, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    for i in m.i:
        m.x[i, 0].fix(places[i - 1])
        m.v[i, 0].fix(speeds[i - 1])
    m.hit = pyomo_fesd.contact(m.c, m.t, gap=lambda m, c, t: m.x[c + 1, t] - m.x[c, t] - 1, restitution=e)
    m.kinematics = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dx[i, t] == m.v[i, t])

    @m.Constraint(m.i, m.t)
    def momentum(m, i, t):
        return m.dv[i, t] == (m.hit[i - 1, t].normal if i > 1 else 0) - (m.hit[i, t].normal if i < 3 else 0)

    return m


def discs(e, end=2.0, T=1, L=1, M=1):
    """A disc of mass 1 that flies at one of mass 2, off its centre by 0.6 of the sum of their radii.

    ``T``, ``L``, ``M`` are the units of time, length and mass, here and below.
    """
    places = {(1, 'x'): -2 * L, (1, 'y'): 0.6 * L, (2, 'x'): 0, (2, 'y'): 0}
    m = pyo.ConcreteModel()
    m.t, m.b, m.d = dae.ContinuousSet(bounds=(0, end * T)), pyo.RangeSet(2), pyo.Set(initialize='xy')
    m.x = pyo.Var(m.b, m.d, m.t, initialize=lambda m, b, d, t: places[b, d])
    m.v = pyo.Var(m.b, m.d, m.t, initialize=lambda m, b, d, t: 2.0 * L / T * ((b, d) == (1, 'x')))
    m.dx, m.dv = dae.DerivativeVar(m.x, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    for b, d in places:
        m.x[b, d, 0].fix()
        m.v[b, d, 0].fix()
    m.distance = pyo.Expression(m.t, rule=lambda m, t: pyo.sqrt(sum((m.x[1, d, t] - m.x[2, d, t]) ** 2 for d in m.d)))
    m.hit = pyomo_fesd.contact(m.t, gap=lambda m, t: m.distance[t] - L, restitution=e)
    m.kinematics = pyo.Constraint(m.b, m.d, m.t, rule=lambda m, b, d, t: m.dx[b, d, t] == m.v[b, d, t])

    @m.Constraint(m.b, m.d, m.t)
    def momentum(m, b, d, t):
        normal = (m.x[b, d, t] - m.x[3 - b, d, t]) / m.distance[t]
        return b * M * m.dv[b, d, t] == normal * m.hit[t].normal

    return m


def after_discs(e):
    """Velocities after their impact at t = 0.6: the normal is (-0.8, 0.6)."""
    impulse = (1 + e) * 1.6 / (1 + 1 / 2)
    return {(1, 'x'): 2 - 0.8 * impulse, (1, 'y'): 0.6 * impulse, (2, 'x'): 0.4 * impulse, (2, 'y'): -0.3 * impulse}


def incline(mu, slope=0.3, end=1.5, height=0.0, speed=2.0, T=1, L=1, M=1):
    """A block on an incline, thrown upwards."""
    g = G * L / T**2
    m = over_time(end * T, s=0.0, n=height * L, v=speed * L / T, w=0.0)
    m.plane = pyomo_fesd.contact(m.t, gap=lambda m, t: m.n[t], friction=mu, slip=lambda m, t: m.v[t])
    m.along = pyo.Constraint(m.t, rule=lambda m, t: m.ds[t] == m.v[t])
    m.across = pyo.Constraint(m.t, rule=lambda m, t: m.dn[t] == m.w[t])
    m.slide = pyo.Constraint(m.t, rule=lambda m, t: 2 * M * m.dv[t] == -2 * M * g * sin(slope) + m.plane[t].friction)
    m.press = pyo.Constraint(m.t, rule=lambda m, t: 2 * M * m.dw[t] == -2 * M * g * cos(slope) + m.plane[t].normal)
    return m


def pushed(end=2.0, T=1, L=1, M=1):
    """A block at rest on a table, pushed by a growing force: it sticks for 1, then slips with 5 (t - 1)."""
    g, force = G * L / T**2, M * L / T**2
    m = over_time(end * T, s=0.0, n=0.0, v=0.0, w=0.0)
    clock = pyomo_fesd.clock(m, m.t)
    m.table = pyomo_fesd.contact(m.t, gap=lambda m, t: m.n[t], friction=0.5, slip=lambda m, t: m.v[t])
    m.along = pyo.Constraint(m.t, rule=lambda m, t: m.ds[t] == m.v[t])
    m.across = pyo.Constraint(m.t, rule=lambda m, t: m.dn[t] == m.w[t])
    m.slide = pyo.Constraint(m.t, rule=lambda m, t: 2 * M * m.dv[t] == 10 * force * clock[t] / T + m.table[t].friction)
    m.press = pyo.Constraint(m.t, rule=lambda m, t: 2 * M * m.dw[t] == -2 * M * g + m.table[t].normal)
    return m


def puck(height, directions=4, turn=0.0, end=1.2, T=1, L=1, M=1):
    """A puck that falls on ice with the speed 2 in the direction ``turn``; the axes of friction are turned by it too."""
    c, s = round(cos(turn), 12), round(sin(turn), 12)
    m = over_time(end * T, x=0.0, y=0.0, z=height * L, u=2 * c * L / T, v=2 * s * L / T, w=0.0)

    def along(m, t):
        return [c * m.u[t] + s * m.v[t], c * m.v[t] - s * m.u[t]]

    m.ice = pyomo_fesd.contact(m.t, gap=lambda m, t: m.z[t], friction=0.25, slip=along, directions=directions)
    for x, v in (('x', 'u'), ('y', 'v'), ('z', 'w')):
        rate, v = m.component(f'd{x}'), m.component(v)
        m.add_component(f'way_{x}', pyo.Constraint(m.t, rule=lambda m, t, rate=rate, v=v: rate[t] == v[t]))
    m.push_x = pyo.Constraint(m.t, rule=lambda m, t: M * m.du[t] == c * m.ice[t].friction[1] - s * m.ice[t].friction[2])
    m.push_y = pyo.Constraint(m.t, rule=lambda m, t: M * m.dv[t] == s * m.ice[t].friction[1] + c * m.ice[t].friction[2])
    m.press = pyo.Constraint(m.t, rule=lambda m, t: M * m.dw[t] == -M * G * L / T**2 + m.ice[t].normal)
    return m


def disc(mu=0.2, end=2.0, height=0.0, speed=3.0, spin=0.0):
    """A disc of mass 1 and radius 1 that slips on the floor until it rolls."""
    m = over_time(end, x=0.0, y=1 + height, v=speed, w=0.0, turn=spin)
    m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.y[t] - 1, friction=mu, slip=lambda m, t: m.v[t] + m.turn[t])
    m.along = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])
    m.across = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.w[t])
    m.slide = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == m.floor[t].friction)
    m.press = pyo.Constraint(m.t, rule=lambda m, t: m.dw[t] == -G + m.floor[t].normal)
    m.spin = pyo.Constraint(m.t, rule=lambda m, t: 0.5 * m.dturn[t] == m.floor[t].friction)
    return m


def bowl(end=0.6, angle=1.0):
    """A bead that slides down in a bowl of radius 1 from rest."""
    m = over_time(end, x=sin(angle), y=-cos(angle), v=0.0, w=0.0)
    m.wall = pyomo_fesd.contact(m.t, gap=lambda m, t: (1 - m.x[t] ** 2 - m.y[t] ** 2) / 2)
    m.along = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])
    m.across = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.w[t])
    m.push = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -m.x[t] * m.wall[t].normal)
    m.press = pyo.Constraint(m.t, rule=lambda m, t: m.dw[t] == -G - m.y[t] * m.wall[t].normal)
    return m


def resting(guess=1.0):
    """A mass without weight that rests on a disc of radius 1, with a force as control; ``guess`` times its place is the start."""
    places = {1: 0.6, 2: 0.8}
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, 1)), pyo.RangeSet(2)
    m.q = pyo.Var(m.i, m.t, initialize=lambda m, i, t: guess * places[i])
    m.v, m.u = pyo.Var(m.i, m.t, initialize=0), pyo.Var(m.i, m.t, bounds=(-1, 1), initialize=0)
    m.dq, m.dv = dae.DerivativeVar(m.q, wrt=m.t), dae.DerivativeVar(m.v, wrt=m.t)
    for i in m.i:
        m.q[i, 0].fix(places[i])
        m.v[i, 0].fix(0)
    m.touch = pyomo_fesd.contact(m.t, gap=lambda m, t: m.q[1, t] ** 2 + m.q[2, t] ** 2 - 1)
    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.v[i, t])
    m.balance = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dv[i, t] == m.u[i, t] + 2 * m.q[i, t] * m.touch[t].normal)
    m.away = pyo.Objective(expr=-(0.6 * m.q[1, 1] + 0.8 * m.q[2, 1]))
    return m


def in_bowl(end=0.6, angle=1.0):
    """x, y, v, w of the bead at ``end``: a pendulum."""
    found = solve_ivp(lambda t, z: [z[1], -G * np.sin(z[0])], (0, end), [angle, 0], rtol=1e-12, atol=1e-13)
    turn, rate = found.y[:, -1]
    return np.array([sin(turn), -cos(turn), rate * cos(turn), rate * sin(turn)])
