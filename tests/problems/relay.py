"""A relay as a mixed complementarity: dx/dt = 3 (1 - z) - z,  0 <= z <= 1  perp  -x,  x(0) = -2, 0 <= t <= 2.

x rises at rate 3 and reaches zero at t = 2/3; there it slides with z = 3/4.  Every way to write it means the same.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, ComplementarityList, complements

SWITCH, SLIDING = 2 / 3, 0.75
WAYS = {
    'inequality': lambda m, t: complements(pyo.inequality(0, m.z[t], 1), -m.x[t]),
    'other order': lambda m, t: complements(-m.x[t], pyo.inequality(0, m.z[t], 1)),
    'bare variable': lambda m, t: complements(m.z[t], -m.x[t]),
    'other order, bare': lambda m, t: complements(-m.x[t], m.z[t]),
    'Params': lambda m, t: complements(pyo.inequality(m.low, m.z[t], m.high), -m.x[t]),
    'declared Params': lambda m, t: complements(m.w[t], -m.x[t]),
    'a tuple': lambda m, t: (pyo.inequality(0, m.z[t], 1), -m.x[t]),
}


def build(way='inequality', x0=-2.0, discretise=None):
    m = plant(x0)
    if way == 'declared Params':
        m.w = pyo.Var(m.t, bounds=(m.low, m.high), initialize=0.5)
        m.same = pyo.Constraint(m.t, rule=lambda m, t: m.w[t] == m.z[t])
    if discretise is not None:
        discretise(m)
    if way == 'block':

        @m.Block(m.t)
        def switch(b, t):
            m = b.model()
            b.relay = Complementarity(expr=WAYS['inequality'](m, t))

    elif way == 'list':

        @m.Block(m.t)
        def switch(b, t):
            m = b.model()
            b.relay = ComplementarityList(rule=[WAYS['inequality'](m, t)])

    else:
        m.relay = Complementarity(m.t, rule=WAYS[way])
    return m


def plant(x0):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.low, m.high = pyo.Param(initialize=0, mutable=True), pyo.Param(initialize=1, mutable=True)
    m.x = pyo.Var(m.t, initialize=x0)
    m.z = pyo.Var(m.t, bounds=(0, 1), initialize=0.5)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(x0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 3 * (1 - m.z[t]) - m.z[t])
    return m


def build_disjunction(x0=-2.0):
    """The same with z given by two modes."""
    m = plant(x0)
    m.relay = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.z[t] == 0], [m.x[t] >= 0, m.z[t] == 1]])
    return m
