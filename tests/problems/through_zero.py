"""A free start or rate through zero: dx/dt = a r(x) with r = BELOW for x <= 0 and ABOVE for x >= 0, on [0, 1], x(0) = p.

With a = 1 and x(0) = p, or with p = -1 and the rate a as the decision, x(1) grows with the decision.  So (x(1) - goal)^2 has one
minimum, of value 0, and none where the switch is at an end of the horizon: at p = 0, p = -BELOW or a = 1 / BELOW.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

RATES = ((3, 1), (1, 3))


def build(goal, rates, decision='start'):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.p, m.a = pyo.Var(initialize=-1, bounds=(-9, 9)), pyo.Var(initialize=1, bounds=(0.1, 9))
    (m.a if decision == 'start' else m.p).fix()
    m.x = pyo.Var(m.t, initialize=0, bounds=(-99, 99))
    m.dx = dae.DerivativeVar(m.x)
    m.start = pyo.Constraint(expr=m.x[0] == m.p)
    m.sign = Disjunction(
        m.t,
        rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == m.a * rates[0]], [m.x[t] >= 0, m.dx[t] == m.a * rates[1]]],
    )
    m.cost = pyo.Objective(expr=(m.x[1] - goal) ** 2)
    return m


def at_the_ends(rates, decision):
    """Decisions with which the switch is at an end of the horizon."""
    return (0.0, -float(rates[0])) if decision == 'start' else (1 / rates[0],)
