"""The control problem of the quickstart with its goal as a parameter: two stages, held controls, a switch at x = 0."""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction


def build(goal=1.0, start=-1.0):
    """The model, discretised."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.goal = pyo.Param(initialize=goal, mutable=True)
    m.x = pyo.Var(m.t, initialize=-1)
    m.u = pyo.Var(m.t, initialize=0, bounds=(-1, 1))
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(start)
    m.speed = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 1 + m.u[t]], [m.x[t] >= 0, m.dx[t] == 3 + m.u[t]]])
    m.effort = dae.Integral(m.t, rule=lambda m, t: m.u[t] ** 2)
    m.cost = pyo.Objective(expr=m.effort + (m.x[2] - m.goal) ** 2)
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=8, ncp=2, piecewise_constant=[m.u])
    return m
