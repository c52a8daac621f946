"""Two relays with rates that are not linear, on as many elements of length 1 as there are seconds, compiled, at a random point.

So a model with one element more has the same nominal lengths, and the same rows but for those of the element.
"""

from types import SimpleNamespace

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from problems.running import transform
from pyomo.common.timing import HierarchicalTimer

import pyomo_fesd
from pyomo_fesd.core import moving_grids
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.subproblems import Parts, active_sets, sort_sides


def build(seconds):
    """The problem as a model."""
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, seconds)), pyo.RangeSet(2)
    m.theta = pyo.Var(initialize=1, bounds=(0.5, 1.5))
    m.x, m.s = pyo.Var(m.t, m.i, initialize=0), pyo.Var(m.t, m.i, initialize=0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.x[0, ...].fix(0)

    @m.Disjunction(m.t, m.i)
    def law(m, t, i):
        return [[m.x[t, i] <= i * m.theta, m.s[t, i] == 0], [m.x[t, i] >= i * m.theta, m.s[t, i] == 1]]

    @m.Constraint(m.t, m.i)
    def rate(m, t, i):
        return m.dx[t, i] == 1 + m.theta * m.s[t, 1] * m.s[t, 2] + 0.05 * m.x[t, 1] * m.x[t, 2]

    m.cost = pyo.Objective(expr=(m.x[seconds, 1] - 2) ** 2 + m.x[seconds, 2] * m.theta)
    return m


def compiled(seconds, form, seed=0):
    """The compiled model with its parts, sides, names of variables, and a random point ``w``."""
    m = transform(build(seconds), seconds, 2, form=form)
    c = compile_mpcc(read_mpcc(m), HierarchicalTimer())
    w = np.random.default_rng(seed).uniform(0.2, 0.9, len(c.x0))
    return SimpleNamespace(m=m, c=c, parts=Parts(c), sides=sort_sides(c), names=[v.name for v in c.variables], w=w)


def simulated(seconds, form, theta=1.3):
    """The same at a simulated point; also its zero sides, and a time inside of each element."""
    m = transform(build(seconds), seconds, 2, form=form)
    m.theta.fix(theta)
    pyomo_fesd.simulate(m)
    m.theta.unfix()
    c = compile_mpcc(read_mpcc(m), HierarchicalTimer())
    at = c.evaluate(c.x0)
    inside = [e.points[0] for e in moving_grids(m)[m.t].grid.elements]
    return SimpleNamespace(
        m=m,
        c=c,
        parts=Parts(c),
        sides=sort_sides(c),
        names=[v.name for v in c.variables],
        w=c.x0.copy(),
        zero=active_sets(at.G, at.H, 1e-7).zero,
        inside=inside,
    )


def rate(x, s, theta):
    """The rates of both states."""
    return np.full(2, 1 + theta * s[0] * s[1] + 0.05 * x[0] * x[1])


def radau(x, s, theta, h):
    """The states after one step of Radau IIA with two points, by fixed-point iteration."""
    A, points = np.array([[5 / 12, -1 / 12], [3 / 4, 1 / 4]]), np.tile(x, (2, 1))
    for _ in range(200):
        points = x + h * A @ np.array([rate(point, s, theta) for point in points])
    return points[-1]
