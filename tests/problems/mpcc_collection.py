"""Published MPCCs with known answers, written out by hand, and a few with a known end that is no solution.

``SOLVABLE`` is the table (ten more are in ``small_mpccs``).  Every value in it was confirmed by enumeration of all branches:
``PYTHONPATH=.:tests python -m problems.branches`` does so again.  MacMPEC is S. Leyffer's collection, whose models also fix the
start values used here; FJQ is Facchinei, Jiang and Qi (1999), A smoothing method for MPECs; Floudas is the Handbook of Test
Problems (1999), chapter 9.
"""

from dataclasses import dataclass, field

import pyomo.environ as pyo
from problems import small_mpccs
from pyomo.mpec import Complementarity, complements


def _variables(**start):
    """A model with free variables of these names and start values; a list makes an indexed one, from 1."""
    m = pyo.ConcreteModel()
    for name, now in start.items():
        if isinstance(now, list):
            setattr(m, name, pyo.Var(range(1, len(now) + 1), initialize=dict(enumerate(now, 1))))
        else:
            setattr(m, name, pyo.Var(initialize=now))
    return m


def _not_negative(*variables):
    for v in variables:
        for data in v.values():
            data.setlb(0)


def _at_most(bound, *variables):
    for v in variables:
        for data in v.values():
            data.setub(bound)


def _pairs(m, *sides):
    """m.c: 0 <= G perp H >= 0 for each (G, H)."""
    m.c = Complementarity(range(len(sides)), rule=lambda m, i: complements(sides[i][0] >= 0, sides[i][1] >= 0))


def fletcher_leyffer():
    """Fletcher, Leyffer, Ralph and Scholtes (2006), example 2.2: one nonlinear row."""
    m = small_mpccs.pair(0.0, 2.0)
    m.f = pyo.Objective(expr=m.x + m.y)
    m.far = pyo.Constraint(expr=m.y**2 >= 1)
    return m


def jr1():
    """MacMPEC jr1 (Jiang and Ralph)."""
    m = _variables(x=0, y=0)
    _not_negative(m.y)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + m.y**2)
    _pairs(m, (m.y, m.y - m.x))
    return m


def jr2():
    """MacMPEC jr2 (Jiang and Ralph)."""
    m = jr1()
    m.f.expr = m.x**2 + (m.y - 1) ** 2
    return m


def kth1():
    """MacMPEC kth1: linear, the optimum is bi-active."""
    m = small_mpccs.pair(1.0, 1.0)
    m.f = pyo.Objective(expr=m.x + m.y)
    return m


def kth3():
    """MacMPEC kth3: minima (0, 1) and (1, 0)."""
    m = small_mpccs.pair(1.0, 1.0)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 / 2 + (m.y - 1) ** 2)
    return m


def scholtes1():
    """MacMPEC scholtes1: an exponential side."""
    m = _variables(x=1, y=1, z=1)
    _not_negative(m.x, m.z)
    m.f = pyo.Objective(expr=(m.x + 1) ** 2 + (m.y - 2.5) ** 2 + (m.z + 1) ** 2)
    _pairs(m, (m.y - pyo.exp(m.x) - pyo.exp(m.z), m.x))
    return m


def scholtes2():
    """MacMPEC scholtes2: bi-active at the optimum."""
    m = scholtes1()
    m.f.expr = (m.x + 1) ** 2 + m.y**2 + 10 * (m.z + 1) ** 2
    return m


def scholtes3():
    """MacMPEC scholtes3: started next to the spurious origin."""
    m = small_mpccs.pair(1e-4, 1e-4)
    m.f = pyo.Objective(expr=((m.x - 1) ** 2 + (m.y - 1) ** 2) / 2)
    return m


def scholtes5():
    """MacMPEC scholtes5: one side in two pairs."""
    m = _variables(x=1, y=1, z=1)
    _not_negative(m.x, m.y, m.z)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 2) ** 2 + (m.z + 1) ** 2)
    _pairs(m, (m.x, m.z), (m.y, m.z))
    return m


def gauvin():
    """MacMPEC gauvin: Gauvin and Savard (1992), a bilevel program."""
    m = _variables(x=7.5, y=0, u=1)
    _not_negative(m.x, m.y, m.u)
    m.x.setub(15)
    m.f = pyo.Objective(expr=m.x**2 + (m.y - 10) ** 2)
    _pairs(m, (4 * (m.x + 2 * m.y - 30) + m.u, m.y), (20 - m.x - m.y, m.u))
    return m


def bard3():
    """MacMPEC bard3: Bard (1988), a nonlinear bilevel program."""
    m = _variables(x=[0, 0], y=[0, 0], u=[0, 0])
    _not_negative(m.x, m.y, m.u)
    x, y, u = m.x, m.y, m.u
    m.f = pyo.Objective(expr=-(x[1] ** 2) - 3 * x[2] - 4 * y[1] + y[2] ** 2)
    m.upper = pyo.Constraint(expr=x[1] ** 2 + 2 * x[2] <= 4)
    m.kkt1 = pyo.Constraint(expr=2 * y[1] + 2 * u[1] - 3 * u[2] == 0)
    m.kkt2 = pyo.Constraint(expr=-5 - u[1] + 4 * u[2] == 0)
    _pairs(m, (x[1] ** 2 - 2 * x[1] + x[2] ** 2 - 2 * y[1] + y[2] + 3, u[1]), (x[2] + 3 * y[1] - 4 * y[2] - 4, u[2]))
    return m


def desilva():
    """MacMPEC desilva: De Silva (1978), FJQ problem 5."""
    m = _variables(x=[0, 0], y=[0, 0], u=[0, 0])
    _not_negative(m.x, m.u)
    x, y, u = m.x, m.y, m.u
    _at_most(2, x)
    m.f = pyo.Objective(expr=sum(x[i] ** 2 - 2 * x[i] + y[i] ** 2 for i in x))
    m.kkt = pyo.Constraint([1, 2], rule=lambda m, i: 2 * y[i] - 2 * x[i] + 2 * (y[i] - 1) * u[i] == 0)
    _pairs(m, *((0.25 - (y[i] - 1) ** 2, u[i]) for i in x))
    return m


def dempe():
    """MacMPEC dempe: Dempe (1992), from MacMPEC's second start.

    For 0 < z = sqrt(x) < 3 the objective rises with z: 28.25 is an infimum that needs w = infinity.  At (1, 1) its first two
    derivatives are zero: 31.25 is B-stationary and no minimum.
    """
    m = _variables(x=0.183193, z=0.428106, w=3.00379)
    _not_negative(m.w)
    m.f = pyo.Objective(expr=(m.x - 3.5) ** 2 + (m.z + 4) ** 2)
    m.kkt = pyo.Constraint(expr=m.z - 3 + 2 * m.z * m.w == 0)
    _pairs(m, (m.x - m.z**2, m.w))
    return m


def df1():
    """MacMPEC df1: Dirkse and Ferris (1997); a curve of solutions."""
    m = _variables(x=0, y=0)
    m.x.setlb(-1)
    m.x.setub(2)
    _not_negative(m.y)
    m.f = pyo.Objective(expr=(m.x - 1 - m.y) ** 2)
    m.h = pyo.Constraint(expr=m.x**2 <= 2)
    m.g = pyo.Constraint(expr=(m.x - 1) ** 2 + (m.y - 1) ** 2 <= 3)
    _pairs(m, (m.y - m.x**2 + 1, m.y))
    return m


def _outrata(*more):
    """Outrata (1994), SIAM J. Optim. 4(2), page 340: MacMPEC outrata31-34, which differ in the terms of the objective."""
    m = _variables(x=[0, 0, 0, 0], y=0)
    _not_negative(m.x, m.y)
    m.y.setub(10)
    x, y = m.x, m.y
    terms = {'x3': (x[3] - 1) ** 2, 'x4': (x[4] - 1) ** 2, '10 x4': 10 * x[4] ** 2, 'y': y**2}
    m.f = pyo.Objective(expr=((x[1] - 3) ** 2 + (x[2] - 4) ** 2 + sum(terms[k] for k in more)) / 2)
    _pairs(
        m,
        ((1 + 0.2 * y) * x[1] - (3 + 1.333 * y) - 0.333 * x[3] + 2 * x[1] * x[4], x[1]),
        ((1 + 0.1 * y) * x[2] - y + x[3] + 2 * x[2] * x[4], x[2]),
        (0.333 * x[1] - x[2] + 1 - 0.1 * y, x[3]),
        (9 + 0.1 * y - x[1] ** 2 - x[2] ** 2, x[4]),
    )
    return m


def outrata31():
    return _outrata()


def outrata32():
    return _outrata('x3')


def outrata33():
    return _outrata('10 x4')


def outrata34():
    return _outrata('x3', 'x4', 'y')


def stackelberg1():
    """MacMPEC stackelberg1: Outrata, Kocvara and Zowe (1998), a Stackelberg game."""
    m = _variables(x=0, y=0, u=0)
    _not_negative(m.x, m.y, m.u)
    m.x.setub(200)
    m.f = pyo.Objective(expr=m.x**2 / 2 + m.x * m.y / 2 - 95 * m.x)
    m.kkt = pyo.Constraint(expr=m.u == 2 * m.y + m.x / 2 - 100)
    _pairs(m, (m.y, m.u))
    return m


def flp2():
    """MacMPEC flp2: Fukushima, Luo and Pang (1998), problem 2; solutions are not isolated."""
    m = _variables(x=[0, 0], y=[0, 0])
    _not_negative(m.x, m.y)
    x, y = m.x, m.y
    _at_most(10, x)
    m.f = pyo.Objective(expr=sum((x[1] + x[2] + y[i] - 15) ** 2 for i in y) / 2)
    _pairs(
        m,
        (y[1], 8 / 3 * x[1] + 2 * x[2] + 2 * y[1] + 8 / 3 * y[2] - 36),
        (y[2], 2 * x[1] + 1.25 * x[2] + 1.25 * y[1] + 2 * y[2] - 25),
    )
    return m


def nash1():
    """MacMPEC nash1a: FJQ problem 6, a generalised Nash equilibrium; both constraints dependent on a set of solutions."""
    m = _variables(x=[0, 0], y=[0, 0], u=[0, 0])
    _not_negative(m.x, m.u)
    x, y, u = m.x, m.y, m.u
    _at_most(10, x)
    m.f = pyo.Objective(expr=sum((x[i] - y[i]) ** 2 for i in x) / 2)
    m.kkt1 = pyo.Constraint(expr=-34 + 2 * y[1] + 8 / 3 * y[2] + u[1] == 0)
    m.kkt2 = pyo.Constraint(expr=-24.25 + 1.25 * y[1] + 2 * y[2] + u[2] == 0)
    _pairs(m, (15 - x[2] - y[1], u[1]), (15 - x[1] - y[2], u[2]))
    return m


def gnash11m():
    """MacMPEC gnash11m: FJQ problem 8, Cournot-Nash with 0 <= y <= L perp u (mixed, for each firm)."""
    cost, capacity, beta = [10, 8, 6, 4, 2], 5, [1.2, 1.1, 1.0, 0.9, 0.8]
    L, gamma = 150, 1.1
    m = _variables(x=75, y=[0, 0, 0, 0], u=[0, 0, 0, 0])
    _not_negative(m.x)
    m.x.setub(L)
    m.Q = pyo.Expression(expr=m.x + sum(m.y.values()))
    m.price = pyo.Expression(expr=5000 ** (1 / gamma) * m.Q ** (-1 / gamma))
    b = beta[0]
    m.f = pyo.Objective(expr=cost[0] * m.x + b / (b + 1) * capacity ** (-1 / b) * m.x ** ((1 + b) / b) - m.x * m.price)

    def marginal(i):
        return cost[i] + capacity ** (-1 / beta[i]) * m.y[i] - m.price + m.y[i] * m.price / (gamma * m.Q)

    m.kkt = pyo.Constraint(m.y.index_set(), rule=lambda m, i: m.u[i] == marginal(i))
    m.c = Complementarity(m.y.index_set(), rule=lambda m, i: complements(pyo.inequality(0, m.y[i], L), m.u[i]))
    return m


def bilevel1m():
    """MacMPEC bilevel1m: FJQ problem 7, with mixed conditions -10 <= y <= 20 perp u."""
    m = _variables(x=[0, 0], y=[0, 0], u=[0, 0, 0, 0])
    x, y, u = m.x, m.y, m.u
    for i in x:
        x[i].setlb(0)
        x[i].setub(50)
    m.f = pyo.Objective(expr=2 * x[1] + 2 * x[2] - 3 * y[1] - 3 * y[2] - 60)
    m.upper = pyo.Constraint(expr=x[1] + x[2] + y[1] - 2 * y[2] <= 40)
    m.kkt = pyo.Constraint([1, 2], rule=lambda m, i: 2 * y[i] - 2 * x[i] + 40 == u[i] - 2 * u[i + 2])
    m.between = Complementarity([1, 2], rule=lambda m, i: complements(pyo.inequality(-10, y[i], 20), u[i]))
    _pairs(m, *((x[i] - 2 * y[i] - 10, u[i + 2]) for i in x))
    return m


def ex9_1_1():
    """Floudas 9.2.2 (Clark and Westerberg 1990), MacMPEC ex9.1.1: linear bilevel, four sides zero at the optimum."""
    m = _variables(x=0, y=[0, 0], s=[0] * 5, u=[0] * 5)
    _not_negative(m.x, m.s, m.u)
    x, y, s, u = m.x, m.y, m.s, m.u
    m.f = pyo.Objective(expr=-x - 3 * y[1] + 2 * y[2])
    m.rows = pyo.ConstraintList()
    for body in (
        -2 * x + y[1] + 4 * y[2] + s[1] - 16,
        8 * x + 3 * y[1] - 2 * y[2] + s[2] - 48,
        -2 * x + y[1] - 3 * y[2] + s[3] + 12,
        -y[1] + s[4],
        y[1] + s[5] - 4,
        -1 + u[1] + 3 * u[2] + u[3] - u[4] + u[5],
        4 * u[1] - 2 * u[2] - 3 * u[3],
    ):
        m.rows.add(body == 0)
    _pairs(m, *((u[i], s[i]) for i in s))
    return m


def ex9_2_2():
    """Floudas 9.3.3 (Shimizu and Aiyoshi 1981), MacMPEC ex9.2.2: rows meet at the optimum, multipliers are not unique."""
    m = _variables(x=0, y=0, s=[0, 0, 0], u=[0, 0, 0])
    _not_negative(m.x, m.y, m.s, m.u)
    x, y, s, u = m.x, m.y, m.s, m.u
    x.setub(15)
    m.f = pyo.Objective(expr=x**2 + (y - 10) ** 2)
    m.upper = pyo.Constraint(expr=y <= x)
    m.rows = pyo.ConstraintList()
    for body in (x + y + s[1] - 20, -y + s[2], y + s[3] - 20, 2 * (x + 2 * y - 30) + u[1] - u[2] + u[3]):
        m.rows.add(body == 0)
    _pairs(m, *((u[i], s[i]) for i in s))
    return m


def ex9_2_6():
    """Floudas 9.3.7 (Falk and Liu 1995), MacMPEC ex9.2.6: solved on the bounds of the follower or at bi-active corners."""
    m = _variables(x=[0, 0], y=[0, 0], s=[0] * 4, u=[0] * 4)
    _not_negative(m.x, m.y, m.s, m.u)
    x, y, s, u = m.x, m.y, m.s, m.u
    m.f = pyo.Objective(expr=sum(x[i] ** 2 - 2 * x[i] + y[i] ** 2 for i in x))
    m.low = pyo.Constraint([1, 2], rule=lambda m, i: s[i] == y[i] - 0.5)
    m.high = pyo.Constraint([1, 2], rule=lambda m, i: s[i + 2] == 1.5 - y[i])
    m.kkt = pyo.Constraint([1, 2], rule=lambda m, i: 2 * (y[i] - x[i]) - u[i] + u[i + 2] == 0)
    _pairs(m, *((u[i], s[i]) for i in s))
    return m


def ex9_2_8():
    """Floudas 9.3.9 (Yezza 1996), MacMPEC ex9.2.8: bilinear objectives."""
    m = _variables(x=0, y=0, s=[0, 0], u=[0, 0])
    _not_negative(m.x, m.y, m.s, m.u)
    x, y, s, u = m.x, m.y, m.s, m.u
    x.setub(1)
    m.f = pyo.Objective(expr=-4 * x * y + 3 * y + 2 * x + 1)
    m.low = pyo.Constraint(expr=s[1] == y)
    m.high = pyo.Constraint(expr=s[2] == 1 - y)
    m.kkt = pyo.Constraint(expr=-(1 - 4 * x) - u[1] + u[2] == 0)
    _pairs(m, *((u[i], s[i]) for i in s))
    return m


def sl1():
    """MacMPEC sl1 (Stein and Lewis): sides of very different size; the start violates bounds."""
    m = _variables(x=[0, 0], p=[0, 0, 0], u=[0, 0, 0])
    _not_negative(m.u)
    x, p, u = m.x, m.p, m.u
    for i, bounds in {1: (10, 1e10), 2: (0.01, 10), 3: (0, 1)}.items():
        p[i].setlb(bounds[0])
        p[i].setub(bounds[1])
    m.f = pyo.Objective(expr=(x[1] - 2) ** 2 + x[2] ** 2)
    m.kkt1 = pyo.Constraint(expr=0.02 * x[1] - 10 * u[1] - u[2] == 0)
    m.kkt2 = pyo.Constraint(expr=2 * x[2] - u[1] - u[3] == 0)
    _pairs(m, (10 * x[1] + x[2] - p[1] - 10, u[1]), (x[1] - p[2] - 2, u[2]), (x[2] - 50 * p[3], u[3]))
    return m


def hakonsen():
    """MacMPEC hakonsen: optimal taxation (Light 1999), maximised, products of three variables."""
    m = _variables(x=[1, 1], leisure=1, p=[0, 0], t=[0, 0])
    _not_negative(m.x, m.leisure, m.p, m.t)
    x, p, t = m.x, m.p, m.t
    m.f = pyo.Objective(expr=(x[1] * x[2] * m.leisure) ** (1 / 3), sense=pyo.maximize)
    m.income = pyo.Constraint(expr=sum(x[i] * p[i] for i in x) + m.leisure + 25 == 100)
    m.revenue = pyo.Constraint(expr=sum(p[i] * t[i] * x[i] for i in x) >= 25)
    _pairs(m, *((1 - p[i], x[i]) for i in x), *((3 * x[i] * p[i] * (1 + t[i]) - 100, p[i]) for i in x))
    return m


def qpec2():
    """MacMPEC qpec2 with 4 and 2 pairs (Jiang and Ralph 1997): in two of them a variable is complementary to itself."""
    m = _variables(x=[1] * 4, y=[1] * 6)
    _not_negative(m.y)
    x, y = m.x, m.y
    m.f = pyo.Objective(expr=sum((x[i] - 1) ** 2 for i in x) + sum((y[i] - 2) ** 2 for i in y))
    _pairs(m, *((y[i], y[i] - x[i]) for i in x), *((y[i], y[i]) for i in (5, 6)))
    return m


def bilin():
    """MacMPEC bilin: Bard and Falk (1982), a linear bilevel program, maximised."""
    m = _variables(x=[1, 1], y=[1, 1, 1], u=[1, 1, 1])
    _not_negative(m.x, m.y, m.u)
    x, y, u = m.x, m.y, m.u
    m.f = pyo.Objective(expr=8 * x[1] + 4 * x[2] - 4 * y[1] + 40 * y[2] + 4 * y[3], sense=pyo.maximize)
    m.upper = pyo.Constraint(expr=x[1] + 2 * x[2] - y[3] <= 1.3)
    _pairs(
        m,
        (2 - u[1] - 2 * u[2] + 4 * u[3], y[1]),
        (1 + u[1] + 4 * u[2] - 2 * u[3], y[2]),
        (2 + u[1] - u[2] - u[3], y[3]),
        (1 + y[1] - y[2] - y[3], u[1]),
        (2 - 4 * x[1] + 2 * y[1] - 4 * y[2] + y[3], u[2]),
        (2 - 4 * x[2] - 4 * y[1] + 2 * y[2] + y[3], u[3]),
    )
    return m


def infeasible():
    """Both sides at least 1/2: each branch contradicts a bound."""
    m = small_mpccs.pair(1.0, 1.0)
    m.f = pyo.Objective(expr=m.x + m.y)
    m.g = pyo.Constraint(expr=m.x >= 0.5)
    m.h = pyo.Constraint(expr=m.y >= 0.5)
    return m


def infeasible_by_rows():
    """Each branch is a line that misses the disc; without complementarity the disc is feasible."""
    m = small_mpccs.pair(0.0, 0.0)
    m.f = pyo.Objective(expr=(m.x - m.y) ** 2)
    m.disc = pyo.Constraint(expr=(m.x - 2) ** 2 + (m.y - 2) ** 2 <= 1)
    return m


def unbounded():
    """Without bound along y = 0; the branch x = 0 is bounded below."""
    m = small_mpccs.pair(1.0, 1.0)
    m.f = pyo.Objective(expr=m.y**2 - m.x)
    return m


def unbounded_quadratic():
    """Concave along both branches; the origin is C-stationary, nothing is B-stationary."""
    m = small_mpccs.pair(1.0, 2.0)
    m.f = pyo.Objective(expr=-(m.x**2) - m.y**2 - m.x)
    return m


def no_objective():
    """An equilibrium: 0 <= x perp 2 x - 3 + y >= 0, 0 <= y perp x + 2 y - 3 >= 0 has the one solution (1, 1)."""
    m = _variables(x=3, y=0)
    _not_negative(m.x, m.y)
    _pairs(m, (m.x, 2 * m.x - 3 + m.y), (m.y, m.x + 2 * m.y - 3))
    return m


def plain_nlp():
    """Hock and Schittkowski 71: no complementarity at all."""
    m = _variables(x=[1, 5, 5, 1])
    x = m.x
    for i in x:
        x[i].setlb(1)
        x[i].setub(5)
    m.f = pyo.Objective(expr=x[1] * x[4] * (x[1] + x[2] + x[3]) + x[3])
    m.product = pyo.Constraint(expr=x[1] * x[2] * x[3] * x[4] >= 25)
    m.sum = pyo.Constraint(expr=sum(x[i] ** 2 for i in x) == 40)
    return m


@dataclass(frozen=True)
class Known:
    """A problem and its answer.

    Attributes
    ----------
    build : callable -> ConcreteModel
    best : float
        objective at the global optimum
    ends : dict relaxation -> float
        where a run from the published start ends in another B-stationary point: its objective
    remark : str
    """

    build: callable
    best: float
    ends: dict = field(default_factory=dict)
    remark: str = ''

    @property
    def name(self):
        return self.build.__name__

    def expected(self, relaxation):
        """Objective at which a run with this option ends."""
        return self.ends.get(relaxation, self.best)


SOLVABLE = (
    Known(fletcher_leyffer, 1.0),
    Known(jr1, 0.5),
    Known(jr2, 0.5, remark='the origin is stationary on one branch'),
    Known(kth1, 0.0, remark='bi-active'),
    Known(kth3, 0.5),
    Known(scholtes1, 2.0),
    Known(scholtes2, 15.0, remark='bi-active'),
    Known(scholtes3, 0.5),
    Known(scholtes5, 1.0),
    Known(gauvin, 20.0),
    Known(bard3, -12.678710938),
    Known(desilva, -1.0),
    Known(dempe, 28.25, {'auto': 31.25, 'scholtes': 31.25, 'elastic': 31.25}, remark='infimum, not attained'),
    Known(df1, 0.0, remark='not isolated'),
    Known(outrata31, 3.2077000),
    Known(outrata32, 3.4494036),
    Known(outrata33, 4.6042536),
    Known(outrata34, 6.5926838),
    Known(stackelberg1, -3266.6666667),
    Known(flp2, 0.0, remark='not isolated'),
    Known(nash1, 0.0, remark='not isolated'),
    Known(gnash11m, -129.9119235, remark='mixed'),
    Known(bilevel1m, 0.0, {'auto': 5.0, 'scholtes': 5.0}, remark='mixed'),
    Known(ex9_1_1, -13.0),
    Known(ex9_2_2, 100.0),
    Known(ex9_2_6, -1.0),
    Known(ex9_2_8, 1.5),
    Known(sl1, 1e-4),
    Known(hakonsen, 24.3668145),
    Known(qpec2, 10.0, remark='bi-active for whatever point'),
    Known(bilin, 18.4, dict.fromkeys(('auto', 'scholtes', 'elastic'), 14.6)),
    Known(plain_nlp, 17.0140173),
)
INFEASIBLE = (infeasible, infeasible_by_rows)
UNBOUNDED = (unbounded, unbounded_quadratic)
