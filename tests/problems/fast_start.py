"""A fast state, and a switch long after it: x' = -rate (x - u) from 0 to the input u, y' = x below 1/5 and y' = 2 x above.

x is at u within a few times 1/rate after each change of u; where u = 1 from time 0 on, y reaches 1/5 after 1/5 + 1/rate, and
y(1) = 2 (1 - 1/rate) - 1/5, to exp(-rate/5).
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

RATE, LEVEL = 1e3, 0.2


def build(points=(0, 1), inputs=(1,), rate=RATE):
    """Control stages between ``points`` with the given ``inputs``; None leaves one free."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    m.x, m.y, m.u = (pyo.Var(m.t, initialize=0) for _ in range(3))
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.x[0].fix(0)
    m.y[0].fix(0)
    for t, number in zip(points[1:], inputs):
        if number is not None:
            m.u[t].fix(number)
    m.fast = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -rate * (m.x[t] - m.u[t]))
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.y[t] <= LEVEL, m.dy[t] == m.x[t]], [m.y[t] >= LEVEL, m.dy[t] == 2 * m.x[t]]])
    return m


def switch(u=1.0, begin=0.0, rate=RATE):
    """Time of the switch where the input is u from ``begin`` on, and 0 before."""
    return begin + LEVEL / u + 1 / rate


def final(u=1.0, begin=0.0, end=1.0, rate=RATE):
    """y at the end."""
    return LEVEL + 2 * u * (end - switch(u, begin, rate))
