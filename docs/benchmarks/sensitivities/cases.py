"""Solved models with parameters and outputs, and where one exists the closed form of the outputs.

A closed form is a function of the parameters that also takes complex numbers: Im f(p + i h)/h is its derivative to all digits.
"""

from collections.abc import Callable
from dataclasses import dataclass

import bouncing_ball
import gas_liquid_tank
import numpy as np
import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.estimation import run as estimation
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements
from scipy.linalg import expm

import pyomo_fesd

STEP = 1e-30


@dataclass(frozen=True)
class Case:
    """A solved model.

    Attributes
    ----------
    name : str
    model : Block
    parameters : list of components
    outputs : callable () -> list
        components and switches of the present solution
    exact : array (outputs, parameters) or None
        derivatives of the closed form
    """

    name: str
    model: object
    parameters: list
    outputs: Callable
    exact: np.ndarray | None = None


def solved(m, **kwds):
    """Transform and solve ``m``."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, **kwds)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.termination_condition == 'optimal'
    return m


def ramp(x0, surface, slow, fast):
    """dx = slow below the surface, fast above; Params for all but x0, which is fixed."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.surface = pyo.Param(initialize=surface, mutable=True)
    m.slow, m.fast = pyo.Param(initialize=slow, mutable=True), pyo.Param(initialize=fast, mutable=True)
    m.x = pyo.Var(m.t, initialize=x0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(x0)
    rule = lambda m, t: [[m.x[t] <= m.surface, m.dx[t] == m.slow], [m.x[t] >= m.surface, m.dx[t] == m.fast]]  # noqa: E731
    m.s = Disjunction(m.t, rule=rule)
    return m


def overflowing(F, k, most):
    """dV = F - k V until V is at its most; then the overflow w keeps it there."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.F, m.k, m.most = (pyo.Param(initialize=p, mutable=True) for p in (F, k, most))
    m.V, m.w = pyo.Var(m.t, initialize=0.0), pyo.Var(m.t, initialize=0.0)
    m.dV = dae.DerivativeVar(m.V)
    m.V[0].fix(0)
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dV[t] == m.F - m.k * m.V[t] - m.w[t])
    m.weir = Complementarity(m.t, rule=lambda m, t: complements(m.w[t] >= 0, m.V[t] <= m.most))
    return m


def controlled(upper):
    """A control in two stages, a mode on either side of a surface, a goal; the upper bound of the control is a Param."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.surface, m.slope, m.goal = (pyo.Param(initialize=p, mutable=True) for p in (0.1, 3.0, 1.2))
    m.most = pyo.Param(initialize=upper, mutable=True)
    m.x, m.u = pyo.Var(m.t, initialize=-2), pyo.Var(m.t, initialize=-0.5, bounds=(-2, m.most))
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-2)
    rule = lambda m, t: [  # noqa: E731
        [m.x[t] <= m.surface, m.dx[t] == m.slope + m.u[t] - 0.3 * m.x[t] * m.u[t]],
        [m.x[t] >= m.surface, m.dx[t] == 1 + m.u[t]],
    ]
    m.s = Disjunction(m.t, rule=rule)
    m.run = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.u[t] ** 2 + 0.1 * m.x[t] ** 2)
    m.miss = pyo.Expression(expr=(m.x[2] - m.goal) ** 2)
    m.cost = pyo.Objective(expr=10 * m.miss + m.run)
    return solved(m, nfe=4, ncp=2, piecewise_constant=[m.u])


def derivatives(f, *p):
    """The derivatives (outputs, parameters) of a closed form."""
    columns = [np.imag(f(*[x + 1j * STEP * (k == n) for n, x in enumerate(p)])) / STEP for k in range(len(p))]
    return np.column_stack(columns)


def crossing(seed):
    """A surface that is crossed."""
    share, x0, slow, fast = np.random.default_rng(seed).uniform([0.2, -1, 0.5, 0.2], [0.8, 1, 4, 5])

    def exact(x0, surface, slow, fast):
        t_s = (surface - x0) / slow
        return np.array([surface + fast * (1 - t_s), t_s])

    surface = x0 + slow * share
    m = solved(ramp(x0, surface, slow, fast), nfe=4, ncp=2)
    parameters = [m.x[0], m.surface, m.slow, m.fast]
    of = derivatives(exact, x0, surface, slow, fast)
    return Case(f'surface crossed ({seed})', m, parameters, lambda: [m.x[1], *pyomo_fesd.switches(m)], of)


def saltation():
    """The fundamental matrix of the oscillator over its switch."""
    m, _ = oscillator.solve(12, 5, 'LAGRANGE-RADAU')
    end, t_s = m.t.last(), oscillator.SWITCH
    before, after = np.array(oscillator.A_INSIDE), np.array(oscillator.A_OUTSIDE)
    x = expm(before * t_s) @ oscillator.X0
    jump = np.eye(2) + np.outer((after - before) @ x, x) / (x @ before @ x)
    exact = expm(after * (end - t_s)) @ jump @ expm(before * t_s)
    return Case('oscillator, curved surface', m, [m.x[0, 1], m.x[0, 2]], lambda: [m.x[end, 1], m.x[end, 2]], exact)


def impacts():
    """A ball after two impacts."""
    horizon, e, g = 1.2, 0.8, bouncing_ball.GRAVITY
    m = bouncing_ball.build(e, horizon)
    solved(m, nfe=8, ncp=2)

    def exact(q, v):
        first = (v + np.sqrt(v**2 + 2 * g * q)) / g
        up = e * (g * first - v)
        second = first + 2 * up / g
        since = horizon - second
        return np.array([e * up * since - g * since**2 / 2, e * up - g * since, first, second])

    outputs = lambda: [m.q[horizon], m.v[horizon], *pyomo_fesd.switches(m)]  # noqa: E731
    return Case('ball, two impacts', m, [m.q[0], m.v[0]], outputs, derivatives(exact, bouncing_ball.HEIGHT, 0.0))


def overflow():
    """A weir that begins to flow."""

    def exact(F, k, most):
        return np.array([-np.log(1 - k * most / F) / k, most, F - k * most])

    m = solved(overflowing(2.0, 0.5, 1.5), nfe=6, ncp=3)
    outputs = lambda: [*pyomo_fesd.switches(m), m.V[2], m.w[2]]  # noqa: E731
    return Case('overflow of a tank', m, [m.F, m.k, m.most], outputs, derivatives(exact, 2.0, 0.5, 1.5))


def levels():
    """Levels at the end and switching times of the tank in the study of estimation, by what is estimated there."""
    m = estimation.build(list(estimation.measurements(0.0)), estimation.TRUTH, 12)
    parameters = [m.component(name) for name in estimation.TRUTH]
    for v in parameters:
        v.fix()
    m.misfit.deactivate()
    pyo.SolverFactory('mpec_hybrid').solve(m)
    end = estimation.HORIZON

    def exact(a, b, c, h_0):
        both = [estimation.exact(u, h, np.array([end]), a, b, c) for u, h in zip(estimation.INFLOWS, (h_0, 0.0))]
        return np.array([*(level[0] for level, _ in both), *(t_s for _, t_s in both)])

    def outputs():
        runs = m.run.values()
        return [*(d.h[end] for d in runs), *(pyomo_fesd.switches(d, d.t)[0] for d in runs)]

    return Case('tank with a side outlet', m, parameters, outputs, derivatives(exact, *estimation.TRUTH.values()))


def estimates(nfe):
    """Estimates of the same tank by the measured levels."""
    data = list(estimation.measurements(0.0))
    m = estimation.build(data, estimation.TRUTH, nfe)
    pyo.SolverFactory('mpec_hybrid').solve(m)

    def all_levels(a, b, c, h_0):
        starts = zip(estimation.INFLOWS, (h_0, 0.0), data)
        return np.concatenate([estimation.exact(u, h, times, a, b, c)[0] for u, h, (times, _) in starts])

    X = derivatives(all_levels, *estimation.TRUTH.values())
    exact = np.linalg.solve(X.T @ X, X.T)
    outputs = lambda: [m.component(name) for name in estimation.TRUTH]  # noqa: E731
    return Case(f'estimates by measurements, {nfe} elements', m, [m.level], outputs, exact)


def slide():
    """The gas-liquid tank: a slide of which no closed form is known."""
    m = solved(gas_liquid_tank.build_eliminated(), nfe=20, ncp=3)
    end = gas_liquid_tank.HORIZON
    outputs = lambda: [m.M_G[end], m.P[end], *pyomo_fesd.switches(m)]  # noqa: E731
    return Case('gas-liquid tank, slide', m, [m.M_G[0], m.M_L[0]], outputs)


def optimal(upper, name):
    """An optimal control; its derivatives are those of the optimal answer."""
    m = controlled(upper)
    outputs = lambda: [m.x[2], m.u[1], m.u[2], m.cost, *pyomo_fesd.switches(m)]  # noqa: E731
    return Case(f'optimal control, {name}', m, [m.surface, m.goal, m.most, m.x[0]], outputs)


#: Functions that build the cases, in the order of the table.
CASES = (
    *(lambda seed=seed: crossing(seed) for seed in range(4)),
    saltation,
    impacts,
    overflow,
    levels,
    slide,
    lambda: estimates(12),
    lambda: estimates(18),
    lambda: optimal(2.0, 'bound inactive'),
    lambda: optimal(-0.1, 'bound active'),
)
