"""Small MPCCs whose branches lead down elsewhere, and their parts."""

from dataclasses import replace

import pyomo.environ as pyo
from problems import small_mpccs
from problems.parts import parts
from pyomo.mpec import Complementarity, complements


def trap(multiplier=2):
    """On x = 0 the minimum is the origin, with multipliers (-2, ``multiplier``); along y = 0 it descends to (1, 0)."""
    m = small_mpccs.pair(0.0, 0.1)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + m.y**2 + multiplier * m.y)
    return m


def c_stationary():
    """The trap with multipliers (-2, 0): a C-stationary origin."""
    return trap(0)


def two_minima(x0=0.0, y0=1.0):
    """(0, 1) with 1 and (1, 0) with 1/2: both strict, each within the other's trust region."""
    m = small_mpccs.pair(x0, y0)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 1) ** 2 / 2)
    return m


def small_sum_of_large_terms(factor=1e8):
    """f = 1 + p - 0.3 q with 0 <= p perp q >= 0, as a difference of two terms of the size ``factor``."""
    m = pyo.ConcreteModel()
    m.p, m.q = pyo.Var(bounds=(0, 1), initialize=0.5), pyo.Var(bounds=(0, 1), initialize=0)
    m.x, m.y = (pyo.Var(bounds=(-2, 2), initialize=0.5) for _ in range(2))
    m.pair = Complementarity(expr=complements(m.p >= 0, m.q >= 0))
    m.small = pyo.Constraint(expr=m.x - m.y == (1 + m.p - 0.3 * m.q) / factor)
    m.f = pyo.Objective(expr=factor * (m.x - m.y))
    return m


def at_point(m, final, **options):
    """Parts after ``explore_from`` the model's values; with the reduced LPEC by default."""
    p = parts(m, **{'lpec': 'reduced'} | options)
    p.branches.explore_from(p.compiled.x0, final)
    return p


def with_a_short_place(p):
    """The incumbent with the variables of a neighbour at their lower bound."""
    point, short = p.run.point, p.compiled.neighbours[0].short
    w = point.w.copy()
    w[short] = p.compiled.lbx[short]
    return replace(point, nlp=replace(point.nlp, w=w))
