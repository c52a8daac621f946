"""Problems with Disjunctions and without time: small ones of the literature, written down here, and models of Pyomo's own tests."""

from itertools import combinations

import pyomo.environ as pyo
from pyomo.gdp import Disjunction
from pyomo.gdp.tests import models

import pyomo_fesd


def jobs(durations):
    """Zero-wait scheduling (Raman and Grossmann 1994): jobs pass the stages in order, none waits, the last one ends early."""
    m = pyo.ConcreteModel()
    horizon = sum(map(sum, durations))
    m.start, m.end = (
        pyo.Var(range(len(durations)), bounds=(0, horizon), initialize=0),
        pyo.Var(bounds=(0, horizon), initialize=horizon),
    )
    m.last = pyo.Constraint(m.start.index_set(), rule=lambda m, i: m.end >= m.start[i] + sum(durations[i]))
    clashes = [
        (i, k, j)
        for i, k in combinations(range(len(durations)), 2)
        for j in range(len(durations[0]))
        if durations[i][j] and durations[k][j]
    ]

    def order(m, i, k, j):
        begin = {job: m.start[job] + sum(durations[job][:j]) for job in (i, k)}
        return [begin[i] + durations[i][j] <= begin[k], begin[k] + durations[k][j] <= begin[i]]

    m.order = Disjunction(clashes, rule=order)
    m.goal = pyo.Objective(expr=m.end)
    return m


def three_jobs():
    return jobs([(5, 0, 3), (0, 3, 2), (2, 4, 0)])


def six_jobs():
    return jobs([(3, 5, 2), (4, 1, 6), (2, 7, 3), (5, 2, 4), (1, 6, 2), (6, 3, 1)])


def strip(sizes, width):
    """Rectangles (along, across) in a strip of a given width, as short as possible (Sawaya and Grossmann 2005)."""
    m = pyo.ConcreteModel()
    n, length = range(len(sizes)), sum(a for a, _ in sizes)
    m.x = pyo.Var(n, bounds=(0, length), initialize=0)
    m.y = pyo.Var(n, bounds=lambda m, i: (0, width - sizes[i][1]), initialize=0)
    m.length = pyo.Var(bounds=(0, length), initialize=length)
    m.inside = pyo.Constraint(n, rule=lambda m, i: m.x[i] + sizes[i][0] <= m.length)

    def apart(m, i, j):
        pairs = ((i, j), (j, i))
        return [m.x[a] + sizes[a][0] <= m.x[b] for a, b in pairs] + [m.y[a] + sizes[a][1] <= m.y[b] for a, b in pairs]

    m.apart = Disjunction(list(combinations(n, 2)), rule=apart)
    m.goal = pyo.Objective(expr=m.length)
    return m


def four_rectangles():
    return strip([(6, 6), (8, 3), (5, 4), (3, 2)], 10)


def discounts(exact=False):
    """Buy 100 tons from six suppliers at prices that fall beyond a limit: concave piecewise linear costs.

    ``exact``: the costs by ``pyomo_fesd.minimum`` in place of Disjunctions.
    """
    m = pyo.ConcreteModel()
    offers = {1: (9, 20, 6), 2: (8, 30, 7), 3: (10, 10, 5.5), 4: (7.5, 45, 6.5), 5: (11, 5, 5.8), 6: (8.5, 25, 6.2)}
    m.bought = pyo.Var(offers, bounds=(0, 40), initialize=100 / 6)
    m.paid = pyo.Var(offers, bounds=(0, 500), initialize=100)
    m.enough = pyo.Constraint(expr=sum(m.bought.values()) == 100)
    m.goal = pyo.Objective(expr=sum(m.paid.values()) + sum(0.01 * k * m.bought[k] for k in offers))

    def terms(m, k):
        price, limit, later = offers[k]
        return price * m.bought[k], (price - later) * limit + later * m.bought[k]

    if exact:
        m.offer = pyo.Block(
            offers, rule=lambda b, k: setattr(b, 'row', pyo.Constraint(expr=m.paid[k] == pyomo_fesd.minimum(b, *terms(m, k))))
        )
    else:
        m.offer = Disjunction(offers, rule=lambda m, k: [[m.paid[k] == term] for term in terms(m, k)])
    return m


def discounts_by_minimum():
    return discounts(exact=True)


def three_discs():
    """The nearest point of three discs, each at a price (Lee and Grossmann 2000, example 1)."""
    m = pyo.ConcreteModel()
    m.x, m.y, m.c = pyo.Var(bounds=(0, 8), initialize=1), pyo.Var(bounds=(0, 8), initialize=1), pyo.Var(bounds=(1, 3), initialize=2)
    centres = {(0, 0): 2, (4, 1): 1, (2, 4): 3}
    m.disc = Disjunction(expr=[[(m.x - a) ** 2 + (m.y - b) ** 2 <= 1, m.c == price] for (a, b), price in centres.items()])
    m.goal = pyo.Objective(expr=(m.x - 3) ** 2 + (m.y - 2) ** 2 + m.c)
    return m


def two_reactors():
    """The conversion and the size of one of two reactors (Lee and Grossmann 2001)."""
    m = pyo.ConcreteModel()
    m.flow, m.conversion, m.price = (
        pyo.Var(bounds=(0, 8), initialize=4),
        pyo.Var(bounds=(0, 1), initialize=0.5),
        pyo.Var(bounds=(1.5, 2.5), initialize=2),
    )
    curves = ((-8, 9, 0.2, 0.95, 2.5), (-10, 15, 0.7, 0.99, 1.5))
    m.reactor = Disjunction(
        expr=[
            [m.flow == a * m.conversion + b, m.conversion >= low, m.conversion <= high, m.price == c]
            for a, b, low, high, c in curves
        ]
    )
    m.demand = pyo.Constraint(expr=m.flow * m.conversion <= 2)
    m.goal = pyo.Objective(expr=-(2 * m.flow * m.conversion - 0.2 * m.flow - m.price))
    return m


def two_choices():
    """An analytical problem, not convex, with two Disjunctions (Trespalacios 2015, eq. 6.6)."""
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(bounds=(0, 5), initialize=2.5), pyo.Var(bounds=(0, 3), initialize=1.5)
    exp = pyo.exp
    m.first = Disjunction(
        expr=[
            [m.y <= 0.4 * exp(m.x / 2), m.y <= 0.5 * (m.x - 2.5) ** 2 + 0.3, m.y <= 6.5 / (m.x / 0.3 + 2) + 1],
            [m.y <= 0.3 * exp(m.x / 1.8), m.y <= 0.7 * (m.x / 1.2 - 2.1) ** 2 + 0.3, m.y <= 6.5 / (m.x / 0.8 + 1.1)],
        ]
    )
    m.second = Disjunction(
        expr=[
            [m.y <= 0.9 * exp(m.x / 2.1), m.y <= 1.3 * (m.x / 1.5 - 1.8) ** 2 + 0.3, m.y <= 6.5 / (m.x / 0.8 + 1.1)],
            [m.y <= 0.4 * exp(m.x / 1.5), m.y <= 1.2 * (m.x - 2.5) ** 2 + 0.3, m.y <= 6 / (m.x / 0.6 + 1) + 0.5],
        ]
    )
    m.goal = pyo.Objective(expr=5 + 0.2 * m.x - m.y)
    return m


def heat_exchangers():
    """Three exchangers, each of one of three sizes with a cost of its own (Turkay and Grossmann 1996)."""
    m = pyo.ConcreteModel()
    m.hot, m.cold = pyo.Var(bounds=(350, 400), initialize=375), pyo.Var(bounds=(450, 500), initialize=475)
    m.area, m.cost = pyo.Var([1, 2, 3], bounds=(1e-3, 50), initialize=15), pyo.Var([1, 2, 3], bounds=(0, 1e5), initialize=2e4)
    sizes = ((2750, 3000, 0, 10), (1500, 15000, 10, 25), (600, 46500, 25, 50))
    m.size = Disjunction(
        [1, 2, 3],
        rule=lambda m, k: [
            [m.cost[k] == factor * m.area[k] ** 0.6 + fixed, m.area[k] >= low, m.area[k] <= high]
            for factor, fixed, low, high in sizes
        ],
    )
    m.recovered = pyo.Constraint(expr=10 * (500 - m.hot) == 1.5 * m.area[1] * ((500 - m.cold) + (m.hot - 350)) / 2)
    m.cooled = pyo.Constraint(expr=10 * (m.hot - 340) == 0.5 * m.area[2] * (40 + (m.hot - 320)) / 2)
    m.heated = pyo.Constraint(expr=7.5 * (560 - m.cold) == m.area[3] * ((600 - m.cold) + 40) / 2)
    m.balance = pyo.Constraint(expr=10 * (500 - m.hot) == 7.5 * (m.cold - 350))
    m.goal = pyo.Objective(expr=sum(m.cost.values()) + 200 * (m.hot - 340) + 600 * (560 - m.cold))
    return m


def eight_processes():
    """Which of eight processes a plant has (Duran 1984, example 3; Turkay and Grossmann 1996): convex, with logic."""
    m = pyo.ConcreteModel()
    limits = {3: 2, 5: 2, 9: 2, 10: 1, 14: 1, 17: 2, 19: 2, 21: 2, 25: 3}
    m.f = pyo.Var(range(2, 26), bounds=lambda m, k: (0, limits.get(k, 10)), initialize=1)
    fixed = {1: 5, 2: 8, 3: 6, 4: 10, 5: 6, 6: 7, 7: 4, 8: 5}
    m.fixed = pyo.Var(fixed, bounds=lambda m, k: (0, fixed[k]), initialize=0)
    f, exp = m.f, pyo.exp

    def unit(k, *rows):
        return [m.fixed[k] == fixed[k], *rows]

    def closed(*streams):
        return [f[k] == 0 for k in streams]

    m.first = Disjunction(expr=[unit(1, exp(f[3]) - 1 == f[2], *closed(4, 5)), unit(2, exp(f[5] / 1.2) - 1 == f[4], *closed(2, 3))])
    m.third = Disjunction(expr=[unit(3, 1.5 * f[9] + f[10] == f[8]), [*closed(9), f[10] == f[8]]])
    m.fourth = Disjunction(
        expr=[
            unit(4, 1.25 * (f[12] + f[14]) == f[13], *closed(15)),
            unit(5, f[15] == 2 * f[16], *closed(12, 14)),
            closed(12, 14, 15),
        ]
    )
    m.sixth = Disjunction(
        expr=[
            unit(6, exp(f[20] / 1.5) - 1 == f[19], *closed(21, 22)),
            unit(7, exp(f[22]) - 1 == f[21], *closed(19, 20)),
            closed(19, 20, 21, 22),
        ]
    )
    m.eighth = Disjunction(expr=[unit(8, exp(f[18]) - 1 == f[10] + f[17]), closed(10, 17, 18)])
    balances = ((13, 19, 21), (17, 9, 16, 25), (11, 12, 15), (6, 7, 8), (23, 20, 22), (23, 14, 24))
    m.balances = pyo.ConstraintList()
    for whole, *parts in balances:
        m.balances.add(f[whole] == sum(f[k] for k in parts))
    m.balances.add(f[3] + f[5] == f[6] + f[11])
    m.ratios = pyo.ConstraintList()
    for row in (f[10] <= 0.8 * f[17], f[10] >= 0.4 * f[17], f[12] <= 5 * f[14], f[12] >= 2 * f[14]):
        m.ratios.add(row)
    uses = {
        '6': m.sixth.disjuncts[0],
        '7': m.sixth.disjuncts[1],
        '4': m.fourth.disjuncts[0],
        '3': m.third.disjuncts[0],
        '8': m.eighth.disjuncts[0],
    }
    y = {name: d.indicator_var for name, d in uses.items()}
    m.logic = pyo.LogicalConstraintList()
    m.logic.add(y['4'].equivalent_to(y['6'].lor(y['7'])))
    m.logic.add(y['3'].implies(y['8']))
    prices = {3: -10, 5: -15, 9: -40, 19: 25, 21: 35, 25: -35, 17: 80, 14: 15, 10: 15, 2: 1, 4: 1, 18: -65, 20: -60, 22: -80}
    m.goal = pyo.Objective(expr=sum(m.fixed.values()) + sum(p * f[k] for k, p in prices.items()) + 122)
    return m


def layout(sizes, circles, prices):
    """Rectangles without overlap, each in one of several circles, near one another (Sawaya 2006, CLay): convex."""
    m = pyo.ConcreteModel()
    n, near = range(len(sizes)), list(prices)

    def within(axis):
        return lambda m, i: (
            min(c[axis] - c[2] + sizes[i][axis] / 2 for c in circles),
            max(c[axis] + c[2] - sizes[i][axis] / 2 for c in circles),
        )

    m.x, m.y = (pyo.Var(n, bounds=within(axis), initialize=lambda m, i: 20 + i) for axis in (0, 1))
    m.dx, m.dy = (pyo.Var(near, bounds=(0, 200), initialize=50) for _ in range(2))
    m.distances = pyo.ConstraintList()
    for i, j in near:
        for d, z in ((m.dx, m.x), (m.dy, m.y)):
            m.distances.add(d[i, j] >= z[i] - z[j])
            m.distances.add(d[i, j] >= z[j] - z[i])

    def apart(m, i, j):
        gaps = [(sizes[i][axis] + sizes[j][axis]) / 2 for axis in (0, 1)]
        return [z[a] + gap <= z[b] for z, gap in zip((m.x, m.y), gaps) for a, b in ((i, j), (j, i))]

    def corners(m, i, c):
        cx, cy, r = circles[c]
        return [
            (m.x[i] + a * sizes[i][0] / 2 - cx) ** 2 + (m.y[i] + b * sizes[i][1] / 2 - cy) ** 2 <= r**2
            for a in (-1, 1)
            for b in (-1, 1)
        ]

    m.apart = Disjunction(near, rule=apart)
    m.place = Disjunction(n, rule=lambda m, i: [corners(m, i, c) for c in range(len(circles))])
    m.goal = pyo.Objective(expr=sum(p * (m.dx[k] + m.dy[k]) for k, p in prices.items()))
    return m


def three_in_circles():
    return layout([(5, 6), (7, 5), (3, 3)], [(15, 10, 6), (50, 80, 5)], {(0, 1): 300, (0, 2): 240, (1, 2): 100})


def four_plants():
    """Four times the heat exchangers, independent of one another: 531,441 choices, and the best of each is known."""
    m = pyo.ConcreteModel()
    m.plant = pyo.Block([1, 2, 3, 4], rule=lambda b, k: b.transfer_attributes_from(heat_exchangers()))
    for b in m.plant.values():
        b.goal.deactivate()
    m.goal = pyo.Objective(expr=sum(b.goal.expr for b in m.plant.values()))
    return m


#: Problems by name: how to build each; 'linear', 'convex' or 'nonconvex'; how to build it with Disjunctions, if it has none.
PROBLEMS = {
    'three jobs': (three_jobs, 'linear', None),
    'six jobs': (six_jobs, 'linear', None),
    'four rectangles': (four_rectangles, 'linear', None),
    'discounts': (discounts, 'linear', None),
    'discounts by minimum': (discounts_by_minimum, 'linear', discounts),
    'two segments (Pyomo)': (models.twoSegments_SawayaGrossmann, 'linear', None),
    'network (Pyomo)': (models.makeExpandedNetworkDisjunction, 'linear', None),
    'two boxes (Pyomo)': (models.grossmann_twoDisj, 'linear', None),
    'logic (Pyomo)': (models.makeLogicalConstraintsOnDisjuncts, 'linear', None),
    'nested (Pyomo)': (models.makeBetweenStepsPaperExample_Nested, 'convex', None),
    'four circles (Pyomo)': (models.fourCircles, 'convex', None),
    'three discs': (three_discs, 'convex', None),
    'eight processes': (eight_processes, 'convex', None),
    'three in circles': (three_in_circles, 'convex', None),
    'two reactors': (two_reactors, 'nonconvex', None),
    'two choices': (two_choices, 'nonconvex', None),
    'heat exchangers': (heat_exchangers, 'nonconvex', None),
    'four plants': (four_plants, 'nonconvex', None),
}
