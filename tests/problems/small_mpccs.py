"""Small published MPCCs with known answers; each function returns ``(model, objective at the solution)``.

Sources: Leyffer and Munson (2007); Scheel and Scholtes (2000); Ralph and Wright (MacMPEC); see each docstring.
"""

import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements


def pair(x0, y0):
    """A model with 0 <= x perp y >= 0 and nothing else."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, None), initialize=x0)
    m.y = pyo.Var(bounds=(0, None), initialize=y0)
    m.c = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    return m


def toy(x0=0.0, y0=0.0):
    """Leyffer and Munson: minima (1, 0) and (0, 1); the origin is C-stationary and spurious."""
    m = pair(x0, y0)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 1) ** 2)
    return m, 1.0


def m_not_s_stationary():
    """min x^3 - y + y^2/2: the origin is M- but not S-stationary, the minimum is (0, 1)."""
    m = pair(0.0, 0.0)
    m.f = pyo.Objective(expr=m.x**3 - m.y + m.y**2 / 2)
    return m, -0.5


def badly_scaled():
    """min (100 x - 1)^2 + (y - 1)^2."""
    m = pair(0.0, 0.0)
    m.f = pyo.Objective(expr=(100 * m.x - 1) ** 2 + (m.y - 1) ** 2)
    return m, 1.0


def ralph1():
    """MacMPEC ralph1: B- but not S-stationary at the origin, no multipliers exist."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, None), initialize=1)
    m.y = pyo.Var(initialize=1)
    m.f = pyo.Objective(expr=2 * m.x - m.y)
    m.c = Complementarity(expr=complements(m.y >= 0, m.y - m.x >= 0))
    return m, 0.0


def ralph2():
    """MacMPEC ralph2: every penalty of the product is unbounded."""
    m = pair(1.0, 1.0)
    m.f = pyo.Objective(expr=m.x**2 + m.y**2 - 4 * m.x * m.y)
    return m, 0.0


def scholtes4():
    """MacMPEC scholtes4: MPCC-LICQ fails at the origin."""
    m = pyo.ConcreteModel()
    m.z = pyo.Var([1, 2], bounds=(0, None), initialize={1: 0, 2: 1})
    m.w = pyo.Var(initialize=0)
    m.f = pyo.Objective(expr=m.z[1] + m.z[2] - m.w)
    m.a = pyo.Constraint([1, 2], rule=lambda m, i: -4 * m.z[i] + m.w <= 0)
    m.c = Complementarity(expr=complements(m.z[1] >= 0, m.z[2] >= 0))
    return m, 0.0


def kth2():
    """MacMPEC kth2: min x + (y - 1)^2."""
    m = pair(1.0, 1.0)
    m.f = pyo.Objective(expr=m.x + (m.y - 1) ** 2)
    return m, 0.0


def bard1():
    """Bard: bilevel program as an MPCC (MacMPEC bard1)."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, None), initialize=1)
    m.y = pyo.Var(bounds=(0, None), initialize=1)
    m.l = pyo.Var([1, 2, 3], bounds=(0, None), initialize=0)
    m.f = pyo.Objective(expr=(m.x - 5) ** 2 + (2 * m.y + 1) ** 2)
    m.kkt = pyo.Constraint(expr=2 * (m.y - 1) - 1.5 * m.x + m.l[1] - m.l[2] * 0.5 + m.l[3] == 0)
    sides = {1: 3 * m.x - m.y - 3, 2: -m.x + 0.5 * m.y + 4, 3: -m.x - m.y + 7}
    m.c = Complementarity([1, 2, 3], rule=lambda m, i: complements(sides[i] >= 0, m.l[i] >= 0))
    return m, 17.0


def maximising():
    """The toy as a maximisation."""
    m = pair(0.0, 0.0)
    m.f = pyo.Objective(expr=-((m.x - 1) ** 2) - (m.y - 2) ** 2, sense=pyo.maximize)
    return m, -1.0


def mixed():
    """-1 <= x <= 1 perp x^3 + x - 1/2: an interior zero of the function is the only feasible point."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(-1, 1), initialize=0)
    m.f = pyo.Objective(expr=(m.x - 0.3) ** 2)
    m.c = Complementarity(expr=complements(pyo.inequality(-1, m.x, 1), m.x**3 + m.x - 0.5))
    return m, (0.4238537990697837 - 0.3) ** 2


ALL = (toy, m_not_s_stationary, badly_scaled, ralph1, ralph2, scholtes4, kth2, bard1, maximising, mixed)
