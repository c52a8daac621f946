"""Control of a ramp with a kink, dx/dt = u below zero and u - 1/2 above, on equal control stages; cost (x - goal)^2 + u^2 / 10.

``relay=True`` adds a heater with hysteresis: dy/dt = 2 - y while on, until y >= 1.2, and -y while off, until y <= 0.8.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

import pyomo_fesd  # noqa: F401  registers the transformations

INTERVAL = 0.5


def build(stages=4, elements=3, ncp=2, relay=False, scheme='LAGRANGE-RADAU', drift=0.0, lengths=None):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=lengths or [k * INTERVAL for k in range(stages + 1)])
    m.goal = pyo.Param(initialize=0.5, mutable=True)
    m.drift = pyo.Param(initialize=drift, mutable=True)
    m.x = pyo.Var(m.t, initialize=-1)
    m.u = pyo.Var(m.t, initialize=1.0, bounds=(-2, 2))
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-1)
    below = lambda m, t: [m.x[t] <= 0, m.dx[t] == m.u[t] + m.drift]  # noqa: E731
    m.kink = Disjunction(m.t, rule=lambda m, t: [below(m, t), [m.x[t] >= 0, m.dx[t] == m.u[t] - 0.5 + m.drift]])
    m.loss = dae.Integral(m.t, rule=lambda m, t: (m.x[t] - m.goal) ** 2 + 0.1 * m.u[t] ** 2)
    hysteresis = []
    if relay:
        m.y = pyo.Var(m.t, initialize=1.0)
        m.dy = dae.DerivativeVar(m.y)
        m.y[0].fix(1.0)

        @m.Disjunct(m.t)
        def heating(d, t):
            m = d.model()
            d.until = pyo.Constraint(expr=m.y[t] <= 1.2)
            d.ode = pyo.Constraint(expr=m.dy[t] == 2 - m.y[t])

        @m.Disjunct(m.t)
        def cooling(d, t):
            m = d.model()
            d.until = pyo.Constraint(expr=m.y[t] >= 0.8)
            d.ode = pyo.Constraint(expr=m.dy[t] == -m.y[t])

        m.relay = Disjunction(m.t, rule=lambda m, t: [m.heating[t], m.cooling[t]])
        m.heating[0].indicator_var.fix(True)
        hysteresis = [m.relay]
    pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=hysteresis)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, nfe=elements * (len(m.t) - 1), ncp=ncp, scheme=scheme, piecewise_constant=[m.u]
    )
    return m


def control_problem(**options):
    m = build(**options)
    m.cost = pyo.Objective(expr=m.loss)
    return m
