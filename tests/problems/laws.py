"""Laws that hold only in the region of their mode, with exact or event-located answers."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction
from scipy.integrate import solve_ivp

from pyomo_fesd import simulate


def solve_with(form, solver, m, nfe=10, ncp=3):
    """Transform with a ``form`` ('hysteresis' too) and solve by 'simulate' or 'mpec_hybrid'."""
    keywords = {'hysteresis': m.mode} if form == 'hysteresis' else {'form': form}
    pyo.TransformationFactory('fesd.dcs').apply_to(m, **keywords)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=ncp)
    if solver == 'simulate':
        simulate(m)
    else:
        pyo.assert_optimal_termination(pyo.SolverFactory(solver).solve(m))
    return m


def over(T, **starts):
    """A model over [0, T] with states that start at the values given, and their derivatives dx."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, T))
    for name, start in starts.items():
        m.add_component(name, pyo.Var(m.t, initialize=start))
        m.component(name)[0].fix(start)
        m.add_component('d' + name, dae.DerivativeVar(m.component(name)))
    return m


@dataclass
class Case:
    """A model, the value to compare, the exact one, and the accuracy of the elements."""

    model: Any
    found: Any
    exact: float
    accuracy: float


def two_tanks():
    """sqrt outflow in both directions: sqrt(c) = 1 - t/2 until the levels are equal at t = 2, exact with three points."""
    m = over(3, h1=2, h2=1)
    m.q = pyo.Var(m.t)
    m.first = pyo.Constraint(m.t, rule=lambda m, t: m.dh1[t] == -m.q[t])
    m.second = pyo.Constraint(m.t, rule=lambda m, t: m.dh2[t] == m.q[t])

    @m.Disjunction(m.t)
    def mode(m, t):
        return [
            [m.h1[t] >= m.h2[t], m.q[t] == 0.5 * pyo.sqrt(m.h1[t] - m.h2[t])],
            [m.h1[t] <= m.h2[t], m.q[t] == -0.5 * pyo.sqrt(m.h2[t] - m.h1[t])],
        ]

    return Case(m, lambda: m.h1[3].value, 1.5, 1e-8)


def torricelli():
    """h = (1 - t/2)**2 until the tank is empty at t = 2, and it stays empty."""
    m = over(3, h=1)
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.h[t] >= 0, m.dh[t] == -pyo.sqrt(m.h[t])], [m.h[t] <= 0, m.dh[t] == 0]])
    return Case(m, lambda: m.h[3].value, 0.0, 1e-8)


def _above_one(law, below, exact, accuracy, start=0.5, T=3):
    m = over(T, x=start)
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] >= 1, m.dx[t] == law(m.x[t])], [m.x[t] <= 1, m.dx[t] == below]])
    return Case(m, lambda: m.x[T].value, exact, accuracy)


def _integrated(rate, T, start):
    return solve_ivp(lambda t, x: [rate(x[0])], (0, T), [start], rtol=1e-12, atol=1e-13, method='DOP853').y[0, -1]


def weir():
    exact = _integrated(lambda x: 1 - 0.7 * max(x - 1, 0) ** 1.5, 3, 0.5)
    return _above_one(lambda x: 1 - 0.7 * (x - 1) ** 1.5, 1, exact, 5e-6)


def root_of_crossing():
    """x' = 1 - sqrt(x - 1)/2 from x = 1 on: with w = sqrt(x - 1), dt = 2 w dw / (1 - w/2)."""
    from scipy.optimize import brentq

    def time(w):
        return 0.5 + 8 * (-np.log(1 - w / 2) - w / 2)

    return _above_one(lambda x: 1 - 0.5 * (x - 1) ** 0.5, 1, 1 + brentq(lambda w: time(w) - 3, 0, 1.99) ** 2, 5e-4)


def logarithm():
    return _above_one(lambda x: 1 - pyo.log(x), 1, _integrated(lambda x: 1 - np.log(max(x, 1)), 3, -0.5), 2e-6, start=-0.5)


def reciprocal():
    """x passes the pole at 0 in the other mode; from x = 1 at t = 1.5 on, x = sqrt(1 + 2 (t - 1.5))."""
    return _above_one(lambda x: 1 / x, 1, 2.0, 5e-6, start=-0.5)


def slide():
    """Both modes lead to x = 1, where the root is 0."""
    return _above_one(lambda x: -1 - pyo.sqrt(x - 1), 1, 1.0, 1e-9)


def valve():
    """The argument is a product with an algebraic variable, written as a sum in one mode."""
    m = over(4, p1=3, p2=1)
    m.q, m.rho = pyo.Var(m.t), pyo.Var(m.t, initialize=1)
    m.density = pyo.Constraint(m.t, rule=lambda m, t: m.rho[t] == 1 + 0.1 * m.p1[t])
    m.outflow = pyo.Constraint(m.t, rule=lambda m, t: m.dp1[t] == -m.q[t])
    m.rises = pyo.Constraint(m.t, rule=lambda m, t: m.dp2[t] == 0.5)

    @m.Disjunction(m.t)
    def mode(m, t):
        return [
            [m.p1[t] >= m.p2[t], m.q[t] == 0.5 * pyo.sqrt(m.rho[t] * (m.p1[t] - m.p2[t]))],
            [m.p1[t] <= m.p2[t], m.q[t] == -0.5 * pyo.sqrt(m.rho[t] * m.p2[t] - m.rho[t] * m.p1[t])],
        ]

    def rates(t, p):
        c = p[0] - p[1]
        return [-0.5 * np.sign(c) * np.sqrt((1 + 0.1 * p[0]) * abs(c)), 0.5]

    def equal(t, p):
        return p[0] - p[1]

    equal.terminal = True
    before = solve_ivp(rates, (0, 4), [3, 1], rtol=1e-11, atol=1e-12, events=equal)
    p = before.y[0, -1]
    after = solve_ivp(rates, (before.t[-1], 4), [p, p + 1e-13], rtol=1e-11, atol=1e-13)
    return Case(m, lambda: m.p1[4].value, after.y[0, -1], 1e-3)


def implicit_root():
    """q**2 == c / 4 with q >= 0 in one mode, none in the other; the levels meet where sqrt(c) / 4 + log(1 - ...) ends."""
    m = over(4, p1=3, p2=1)
    m.q = pyo.Var(m.t, bounds=(0, None), initialize=0.5)
    m.outflow = pyo.Constraint(m.t, rule=lambda m, t: m.dp1[t] == -m.q[t])
    m.rises = pyo.Constraint(m.t, rule=lambda m, t: m.dp2[t] == 0.5)
    m.mode = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.p1[t] >= m.p2[t], m.q[t] ** 2 == 0.25 * m.p1[t] - 0.25 * m.p2[t]],
            [m.p1[t] <= m.p2[t], m.q[t] == 0],
        ],
    )
    # c' = -(w + 1)/2 with w = sqrt(c): dt = -4 w dw / (w + 1), from sqrt(2) to 0; then p1 = p2 = 1 + t/2
    w = np.sqrt(2)
    return Case(m, lambda: m.p1[4].value, 1 + 0.5 * 4 * (w - np.log(1 + w)), 2e-3)


def three_modes():
    """A function whose sign does not matter to one mode; the others own one region each."""
    m = over(4, x=-1, y=-1)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 1)

    @m.Disjunction(m.t)
    def mode(m, t):
        law = 0.5 + 0.2 * pyo.sqrt(m.x[t])
        return [
            [m.x[t] <= 0, m.dx[t] == 1 - 0.1 * pyo.sqrt(-m.x[t])],
            [m.x[t] >= 0, m.y[t] <= 1, m.dx[t] == law],
            [m.x[t] >= 0, m.y[t] >= 1, m.dx[t] == law - 0.1 * (m.y[t] - 1) ** 1.5],
        ]

    # until x = 0: w = sqrt(-x), dt = 2 w dw / (1 - w/10); later ordinary
    begin = 20 * (-10 * np.log(0.9) - 1)
    after = solve_ivp(
        lambda t, x: [0.5 + 0.2 * np.sqrt(max(x[0], 0)) - 0.1 * max(t - 2, 0) ** 1.5], (begin, 4), [0.0], rtol=1e-11, atol=1e-12
    )
    return Case(m, lambda: m.x[4].value, after.y[0, -1], 1e-3)


def nested():
    m = over(3, x=-0.5)

    @m.Disjunct(m.t)
    def low(d, t):
        d.region = pyo.Constraint(expr=m.x[t] <= 1)
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunct(m.t)
    def high(d, t):
        d.region = pyo.Constraint(expr=m.x[t] >= 1)
        d.inner = Disjunction(
            expr=[
                [m.x[t] <= 1.5, m.dx[t] == 1 - 0.5 * (m.x[t] - 1) ** 1.5],
                [m.x[t] >= 1.5, m.dx[t] == 1 - 0.5**2.5 - 0.3 * pyo.sqrt(m.x[t] - 1.5)],
            ]
        )

    m.mode = Disjunction(m.t, rule=lambda m, t: [m.low[t], m.high[t]])
    exact = _integrated(lambda x: 1 - 0.5 * np.clip(x - 1, 0, 0.5) ** 1.5 - 0.3 * np.sqrt(max(x - 1.5, 0)), 3, -0.5)
    return Case(m, lambda: m.x[3].value, exact, 5e-4)


def two_weirs():
    """Indexed by a further set, with a mutable crest and the law in an Expression."""
    m = pyo.ConcreteModel()
    m.t, m.item = dae.ContinuousSet(bounds=(0, 3)), pyo.Set(initialize=['a', 'b'])
    m.crest = pyo.Param(m.item, initialize={'a': 1, 'b': 1.5}, mutable=True)
    m.x = pyo.Var(m.item, m.t, initialize=-0.5)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i in m.item:
        m.x[i, 0].fix(-0.5)
    m.law = pyo.Expression(m.item, m.t, rule=lambda m, i, t: 1 - 0.5 * (m.x[i, t] - m.crest[i]) ** 1.5)
    m.mode = Disjunction(
        m.item,
        m.t,
        rule=lambda m, i, t: [
            [m.x[i, t] <= m.crest[i], m.dx[i, t] == 1],
            [m.x[i, t] >= m.crest[i], m.dx[i, t] == m.law[i, t]],
        ],
    )
    return Case(m, lambda: m.x['b', 3].value, _integrated(lambda x: 1 - 0.5 * max(x - 1.5, 0) ** 1.5, 3, -0.5), 3e-5)


def arcsine():
    m = over(3, x=-2)

    @m.Disjunction(m.t)
    def mode(m, t):
        x, dx = m.x[t], m.dx[t]
        return [[x <= -1, dx == 1], [x >= -1, x <= 1, dx == 1.2 + 0.3 * pyo.asin(x)], [x >= 1, dx == 1]]

    # in the middle x = sin(s), dt = cos(s) ds / (1.2 + 0.3 s)
    s = np.linspace(-np.pi / 2, np.pi / 2, 20001)
    middle = np.trapezoid(np.cos(s) / (1.2 + 0.3 * s), s)
    return Case(m, lambda: m.x[3].value, 1 + (3 - 1 - middle), 3e-3)


def pole_of_the_other():
    """The poles of both laws lie in the other region: z = x + 1/2 has z z' = -1; below x = 0, (1 - x)**2.5 = 1 + 5 (t - 1)."""
    m = over(3, x=1)
    m.mode = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] >= 0, m.dx[t] == -1 / (m.x[t] + 0.5)],
            [m.x[t] <= 0, m.dx[t] == -2 / (1 - m.x[t]) ** 1.5],
        ],
    )
    return Case(m, lambda: m.x[3].value, 1 - 11**0.4, 5e-5)


CASES = (
    two_tanks,
    torricelli,
    weir,
    root_of_crossing,
    logarithm,
    reciprocal,
    valve,
    implicit_root,
    three_modes,
    nested,
    two_weirs,
    arcsine,
    pole_of_the_other,
)
