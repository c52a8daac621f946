"""Entering a slide: dx/dt = -sgn x, x(0) = -0.5, 0 <= t <= 1.5; from t = 0.5 on x = 0 with both modes at one half."""

import pyomo.environ as pyo
from problems.states import over_time
from pyomo.gdp import Disjunction

SWITCH, NU = 0.5, 0.5
CURVED = {'switch': (3**0.5 - 1) / 2, 'x': -(0.45**2), 'nu': 0.05}  # the curved slide, x and nu at its end


def build():
    m = over_time(1.5, x=-0.5)

    @m.Disjunct(m.t)
    def rising(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunct(m.t)
    def falling(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == -1)

    m.friction = Disjunction(m.t, rule=lambda m, t: [m.rising[t], m.falling[t]])
    return m


def build_curved():
    """The slide on a curved surface, x + y^2 = 0 with dy/dt = 1: dx/dt = -sgn(x + y^2), x(0) = -0.5, y(0) = 0.

    There x = -t^2, so that nu = 1/2 - t.
    """
    m = over_time(0.45, x=-0.5, y=0)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 1)
    m.bowl = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] + m.y[t] ** 2 <= 0, m.dx[t] == 1],
            [m.x[t] + m.y[t] ** 2 >= 0, m.dx[t] == -1],
        ],
    )
    return m
