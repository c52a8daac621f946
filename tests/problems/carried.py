"""Two control stages, dx/dt = 3 u below zero and u above, x(0) = -2, x(2) = 1, min u1^2 + 2 u2^2 with u held on [0, 1] and [1, 2].

With zero reached inside the first stage or the second u1 + u2 = 5/3, so u1 = 10/9, u2 = 5/9 with the value 50/27 is best; zero is
then reached at t = 3/5.  Where zero is reached just at t = 1, u1 = 2/3 and u2 = 1 with the value 22/9: a solution that no small
step leaves, as an element would have to appear on one side of t = 1.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

import pyomo_fesd
from tests.problems.running import move

CONTROLS, SWITCH, VALUE = (10 / 9, 5 / 9), 0.6, 50 / 27
STUCK, STUCK_VALUE = (2 / 3, 1.0), 22 / 9


def build(start=1.0):
    """As a Disjunction, for ``fesd.dcs`` with or without memory."""
    m = _stages(start)
    m.zero = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3 * m.u[t]], [m.x[t] >= 0, m.dx[t] == m.u[t]]])
    return m


def build_with_jump(start=1.0):
    """The factor k as a state that jumps from 3 to 1 where the distance z to zero is used up."""
    m = _stages(start)
    m.k, m.z = pyo.Var(m.t, initialize=3), pyo.Var(m.t, initialize=2)
    m.dk, m.dz = dae.DerivativeVar(m.k), dae.DerivativeVar(m.z)
    m.k[0].fix(3)
    m.z[0].fix(2)
    m.rate = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.k[t] * m.u[t])
    m.constant = pyo.Constraint(m.t, rule=lambda m, t: m.dk[t] == 0)
    m.distance = pyo.Constraint(m.t, rule=lambda m, t: m.dz[t] == -m.dx[t])
    m.change = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.z[t], reset=lambda m, t: [(m.k[t], 1), (m.z[t], 9)])
    return m


def simulated_with_jump(nfe):
    """``build_with_jump`` on elements, simulated with the best controls."""
    m = build_with_jump()
    move(m, nfe, 2, piecewise_constant=[m.u])
    for t in m.t:
        m.u[t].value = CONTROLS[t > 1]
    pyomo_fesd.simulate(m)
    return m


def _stages(start):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x = pyo.Var(m.t, initialize=lambda m, t: 3 * t / 2 - 2)
    m.u = pyo.Var(m.t, initialize=start, bounds=(0, 4))
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-2)
    m.end = pyo.Constraint(expr=m.x[2] == 1)
    m.cost = pyo.Objective(expr=m.u[1] ** 2 + 2 * m.u[2] ** 2)
    return m
