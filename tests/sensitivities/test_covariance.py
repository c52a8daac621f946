"""Covariance of estimates: against ordinary least squares, against propagated noise, and against Monte Carlo."""

import numpy as np
import pyomo.environ as pyo
import pytest

from pyomo_fesd import FesdError, at, covariance, sensitivity, switches
from tests.estimation.test_at import ramp

TIMES, NOISE = np.linspace(0.1, 1.9, 13), 0.02


def test_linear_regression():
    random = np.random.default_rng(0)
    X, y = random.normal(size=(8, 2)), random.normal(size=8)
    m = pyo.ConcreteModel()
    m.a = pyo.Var([0, 1], initialize=0.0)
    m.sum = pyo.Expression(expr=m.a[0] + m.a[1])
    m.o = pyo.Objective(expr=sum((sum(X[k, i] * m.a[i] for i in m.a) - y[k]) ** 2 for k in range(8)))
    pyo.SolverFactory('mpec_hybrid').solve(m)
    exact = 0.25 * np.linalg.inv(X.T @ X)
    assert covariance(m, m.a, 0.25).to_numpy() == pytest.approx(exact, rel=1e-6)
    assert covariance(m, m.sum, 0.25).iloc[0, 0] == pytest.approx(exact.sum(), rel=1e-6)


def fitted(data):
    """Slope and surface of the ramp, fitted to ``data``, mutable Params."""
    m = ramp(nfe=4)
    m.slope.unfix(), m.surface.unfix()
    m.data = pyo.Param(range(len(TIMES)), initialize=dict(enumerate(data)), mutable=True)
    m.misfit = pyo.Objective(expr=sum((at(m.x, float(t)) - m.data[k]) ** 2 for k, t in enumerate(TIMES)))
    return m


def test_noise_through_a_switch():
    exact = np.minimum(-2 + 3 * TIMES, TIMES - 2 / 3)
    m, random = fitted(exact), np.random.default_rng(1)
    solver = pyo.SolverFactory('mpec_hybrid')
    solver.set_instance(m, [m.data])
    solver.solve(m)
    estimates = [m.slope, m.surface, *switches(m)]
    found = covariance(m, estimates, NOISE**2).to_numpy()
    J = sensitivity(m, m.data, estimates).to_numpy()
    assert found == pytest.approx(J @ J.T * NOISE**2, rel=1e-4)
    samples = []
    for _ in range(25):
        for k, x in enumerate(exact):
            m.data[k] = x + NOISE * random.normal()
        assert solver.solve(m, warm_start=True).solver.termination_condition == 'optimal'
        samples.append([m.slope.value, m.surface.value, switches(m)[0].time])
    # the standard deviation of 25 samples is known to 14 %
    assert np.std(samples, axis=0, ddof=1) == pytest.approx(np.sqrt(np.diag(found)), rel=0.4)


def test_refuses_without_an_objective_or_a_minimum():
    m = ramp()
    pyo.SolverFactory('mpec_hybrid').solve(m)
    with pytest.raises(FesdError, match='no objective'):
        covariance(m, m.x[2])
    m = pyo.ConcreteModel()
    m.a, m.b = pyo.Var(initialize=0.0), pyo.Var(initialize=0.0)
    m.o = pyo.Objective(expr=m.a**2 - m.b**2)
    with pytest.raises(FesdError, match='no minimum'):
        covariance(m, [m.a, m.b])
