"""Zeno: two tanks that lose 1/2 each, a hose of 3/4 that goes to the empty one; from (1, 1), with the hose in the first.

The hose changes at t = 2, 5, 6.5, ...; the intervals halve, and the changes accumulate at t = 8.  At t = 7 both levels are
1/8.
"""

import pyomo.dae as dae
import pyomo.environ as pyo

LIMIT = 8.0
#: before t = 7.25, with the levels at t = 7
CHANGES, END, LEVELS = (2.0, 5.0, 6.5), 7.0, (0.125, 0.125)


def build(end=END):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    m.i = pyo.Set(initialize=[1, 2])
    m.x = pyo.Var(m.i, m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i in m.i:
        m.x[i, 0].fix(1)

    @m.Disjunct(m.i, m.t)
    def fill(d, i, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.x[3 - i, t] >= 0)
        d.flows = pyo.Constraint(m.i, rule=lambda d, j: d.model().dx[j, t] == (0.75 if i == j else 0) - 0.5)

    @m.Disjunction(m.t)
    def hose(m, t):
        return [m.fill[1, t], m.fill[2, t]]

    m.fill[1, 0].indicator_var.fix(True)
    return m
