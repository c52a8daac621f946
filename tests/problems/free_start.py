"""Wrong sensitivity and false minima: dx/dt = 2 - sgn(x) from a start below zero, 0 <= t <= 2.

x reaches zero at -x0/3 and ends at x(2) = 2 + x0/3: the true sensitivity is 1/3, where a fixed grid gives 0 or 1.
Of  int_0^2 x^2 dt + (x(2) - 5/3)^2  over x0 there is one minimum, where a fixed grid has one for each step.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

SENSITIVITY = 1 / 3
START, VALUE = -1.427572232082767, 1.523772775  # the minimum over x0


def build(x0=-1.0, bounds=(0, 2), discretise=None):
    """The start is fixed.  With ``discretise``, a function of the model, the modes are declared on the grid that it lays."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=bounds)
    m.x = pyo.Var(m.t, initialize=x0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[bounds[0]].fix(x0)
    if discretise is not None:
        discretise(m)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3], [m.x[t] >= 0, m.dx[t] == 1]])
    return m


def build_free(guess=-1.0):
    """The start is free in [-2, -0.8], with an objective."""
    m = build(guess)
    m.x[0].unfix()
    m.x[0].setlb(-2)
    m.x[0].setub(-0.8)
    m.integral = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.x[t] ** 2)
    m.cost = pyo.Objective(expr=m.integral + (m.x[2] - 5 / 3) ** 2)
    return m
