"""Two or more experiments over one time: dx_i/dt = 1 below a threshold and 3 above, x_i(0) = 0, on [0, 2].

The thresholds theta and 2 - theta fall together at theta = 1, where the switches at t = theta and t = 2 - theta change their order.
x_1(2) = 6 - 2 theta and x_2(2) = 2 + 2 theta, so a least-squares fit to the values for theta = 1.3 has the misfit
8 (theta - 1.3)^2, 0.72 with the slope -4.8 at theta = 1.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

END, TRUE = 2.0, 1.3
FALSE_MISFIT = 0.72


def build(start=1.0, thresholds=(lambda theta: theta, lambda theta: 2 - theta), hysteresis=False):
    """A least-squares fit of theta to the final states of as many experiments as there are thresholds."""
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, END)), pyo.RangeSet(len(thresholds))
    m.theta = pyo.Var(initialize=start, bounds=(0.1, 1.9))
    m.x = pyo.Var(m.t, m.i, initialize=0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.x[0, ...].fix(0)
    m.law = Disjunction(
        m.t,
        m.i,
        rule=lambda m, t, i: [
            [m.x[t, i] <= thresholds[i - 1](m.theta), m.dx[t, i] == 1],
            [m.x[t, i] >= thresholds[i - 1](m.theta), m.dx[t, i] == 3],
        ],
    )
    data = [3 * END - 2 * threshold(TRUE) for threshold in thresholds]
    m.misfit = pyo.Objective(expr=sum((m.x[END, i] - data[i - 1]) ** 2 for i in m.i))
    return m
