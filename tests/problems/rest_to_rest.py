"""A mass moved by 1 from rest to rest in the shortest time, -2 <= u <= 1: full speed ahead for 2/sqrt(3), then full brakes.

T = sqrt(3), the switch at two thirds of it.
"""

import pyomo.dae as dae
import pyomo.environ as pyo

SHORTEST = 3**0.5


def build(points=(0, 1), scaled=False):
    """With ``scaled`` the equations themselves carry T, over labels of length 1."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    m.T = pyo.Var(bounds=(0.1, None), initialize=1)
    m.q, m.v = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
    m.u = pyo.Var(m.t, bounds=(-2, 1), initialize=0)
    m.dq, m.dv = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v)
    factor = m.T if scaled else 1
    m.way = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == factor * m.v[t])
    m.speed = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == factor * m.u[t])
    for state, last in ((m.q, 1), (m.v, 0)):
        state[m.t.first()].fix(0)
        state[m.t.last()].fix(last)
    m.cost = pyo.Objective(expr=m.T)
    return m
