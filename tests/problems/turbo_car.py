"""A car with a turbo and no hysteresis: acceleration u below the speed 10 and 3 u above, |u| <= 5, at most 25, from rest to rest.

The shortest time for a distance: 5 up to 10 (2 s, 10 m), 15 up to 25 (1 s, 17.5 m), cruise, and the same back, so 55 m take 6 s,
and every 25 m more take another.  A car that sees no turbo needs sqrt(4 * 55/5) = 6.63 s for 55 m.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

SHIFT, FULL, CRUISE = 10.0, 5.0, 25.0
SHORT = 55.0
SHORTEST = 6.0


def build(points, distance=SHORT):
    """The labels of the stages are any numbers; the objective is left to the caller."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    end = m.t.last()
    m.q = pyo.Var(m.t, initialize=lambda m, t: distance * t / end)
    m.v = pyo.Var(m.t, bounds=(0, CRUISE), initialize=lambda m, t: 2 * CRUISE * min(t, end - t) / end)
    m.u = pyo.Var(m.t, bounds=(-FULL, FULL), initialize=lambda m, t: FULL if t < end / 2 else -FULL)
    m.a = pyo.Var(m.t, initialize=0)
    m.dq, m.dv = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v)
    m.way = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.speed = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == m.a[t])
    m.turbo = Disjunction(m.t, rule=lambda m, t: [[m.v[t] <= SHIFT, m.a[t] == m.u[t]], [m.v[t] >= SHIFT, m.a[t] == 3 * m.u[t]]])
    for state, last in ((m.q, distance), (m.v, 0)):
        state[0].fix(0)
        state[end].fix(last)
    return m
