"""Two carts: the first one is driven and has to push the second one to its place; nothing touches at the start.

    q_i' = v_i,   v_1' = u - N - v_1,   v_2' = N - v_2,   0 <= N perp q_2 - q_1 - 1/2 >= 0,   inelastic,   |u| <= 5, T = 2

from q = (0, 1), v = 0;   min int u^2 / 10 dt + 10 (q_2(T) - 2)^2: 10 if nothing touches.
"""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from scipy.integrate import solve_ivp

import pyomo_fesd

END = 2
UNTOUCHED = 10.0


def build(stages, elements):
    """The problem on ``stages`` control stages of ``elements`` elements, Radau 2."""
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(initialize=[END * k / stages for k in range(stages + 1)]), pyo.RangeSet(2)
    m.q = pyo.Var(m.i, m.t, initialize=lambda m, i, t: i - 1)
    m.v, m.u = pyo.Var(m.i, m.t, initialize=0), pyo.Var(m.t, bounds=(-5, 5), initialize=0)
    m.dq, m.dv = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v)
    m.q[:, 0].fix()
    m.v[:, 0].fix()
    m.touch = pyomo_fesd.contact(m.t, gap=lambda m, t: m.q[2, t] - m.q[1, t] - 0.5)
    m.way = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dq[i, t] == m.v[i, t])
    m.driven = pyo.Constraint(m.t, rule=lambda m, t: m.dv[1, t] == m.u[t] - m.touch[t].normal - m.v[1, t])
    m.pushed = pyo.Constraint(m.t, rule=lambda m, t: m.dv[2, t] == m.touch[t].normal - m.v[2, t])
    m.effort = dae.Integral(m.t, rule=lambda m, t: 0.1 * m.u[t] ** 2)
    m.cost = pyo.Objective(expr=m.effort + 10 * (m.q[2, END] - 2) ** 2)
    transformation = pyo.TransformationFactory('fesd.finite_elements')
    transformation.apply_to(m, nfe=elements * stages, ncp=2, piecewise_constant=[m.u])
    return m


def replay(u):
    """The objective of the controls ``u`` of equal stages, by integration with located events.

    Closed carts share the velocity v' = u/2 - v, and N = u/2; they come apart where u is negative.
    """
    h, cost, closed = END / len(u), 0.0, False
    x = np.array([0.0, 1.0, 0.0, 0.0])
    for force in u:
        cost, left, closed = cost + 0.1 * force**2 * h, h, closed and force > 0
        while left > 1e-13:
            law, events = (together, None) if closed else (apart, gap)
            found = solve_ivp(law, (0, left), x, args=(force,), events=events, rtol=1e-11, atol=1e-12)
            x, left = found.y[:, -1], left - found.t[-1]
            if found.status == 1:
                x[2:] = x[2:].mean()
                closed = force > 0
    return cost + 10 * (x[1] - 2) ** 2


def together(t, x, force):
    """Motion while the carts touch."""
    return [x[2], x[3], *[force / 2 - x[2]] * 2]


def apart(t, x, force):
    """Motion while they do not."""
    return [x[2], x[3], force - x[2], -x[3]]


def gap(t, x, force):
    """The distance of the carts."""
    return x[1] - x[0] - 0.5


gap.terminal, gap.direction = True, -1
