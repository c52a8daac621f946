"""Steps of Newton's method: dense and sparse methods agree, and a singular matrix gives none."""

from types import SimpleNamespace

import numpy as np
import pytest

from pyomo_fesd.simulation import newton
from pyomo_fesd.simulation.newton import DENSE, DENSE_LEAST_SQUARES, NewtonSystem


def linear(M, b):
    """The system M w = b as residuals with a constant Jacobian."""
    i, j = np.nonzero(np.ones_like(M))
    (m, n) = M.shape
    return SimpleNamespace(V=np.zeros(m), lower=np.zeros(n), rows=i, columns=j, evaluate=lambda w: (M @ w - b, M[i, j]))


def solution(M, b):
    """The zero that is found from 0."""
    m, n = M.shape
    return NewtonSystem(linear(M, b), np.arange(m), np.arange(n)).solve(np.zeros(n))


@pytest.mark.parametrize('n', [5, DENSE_LEAST_SQUARES, DENSE_LEAST_SQUARES + 1, DENSE, DENSE + 1])
@pytest.mark.parametrize('surplus', [0, 3])
@pytest.mark.parametrize('scale', [1e-6, 1.0, 1e6])
def test_consistent_systems_are_solved(n, surplus, scale):
    rng = np.random.default_rng(n + surplus)
    M, exact = rng.normal(size=(n + surplus, n)) * scale, rng.normal(size=n)
    assert solution(M, M @ exact) == pytest.approx(exact, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize('n', [5, DENSE_LEAST_SQUARES, DENSE_LEAST_SQUARES + 1, DENSE])
@pytest.mark.parametrize('scale', [1e-3, 1.0, 1e3])
def test_least_squares_refuse_columns_that_depend_on_one_another(n, scale):
    rng = np.random.default_rng(n)
    M = rng.normal(size=(n + 3, n)) * scale
    M[:, 1] = M[:, 0]
    assert solution(M, M @ rng.normal(size=n)) is None


@pytest.mark.parametrize('n', [5, DENSE_LEAST_SQUARES + 1])
def test_inconsistent_systems_have_no_solution(n):
    rng = np.random.default_rng(n)
    assert solution(rng.normal(size=(n + 3, n)), rng.normal(size=n + 3)) is None


@pytest.mark.parametrize('surplus', [0, 3])
def test_an_unknown_without_an_entry_is_refused_in_a_large_system(surplus):
    """SuperLU may abort the process there."""
    n = max(DENSE, DENSE_LEAST_SQUARES) + 10
    M = np.random.default_rng(0).normal(size=(n + surplus, n))
    M[:, 1] = 0
    assert solution(M, M @ np.ones(n)) is None


class Counted:
    """The system M w + c w**3 = b, whose matrix is different at each zero."""

    def __init__(self, M, c):
        self.M, self.c, self.b = M, c, None
        (self.rows, self.columns), n = np.nonzero(np.ones_like(M)), len(M)
        self.V, self.lower = np.zeros(n), np.zeros(n)

    def evaluate(self, w):
        J = self.M + np.diag(3 * self.c * w**2)
        return self.M @ w + self.c * w**3 - self.b, J[self.rows, self.columns]

    def at(self, w):
        """Let ``w`` be the zero."""
        self.b = self.M @ w + self.c * w**3
        return w


@pytest.mark.parametrize('c, factored_again', [(0.0, 0), (1e-9, 0), (1.0, 1)])
def test_the_factors_of_one_element_serve_the_next_ones_while_they_contract(monkeypatch, c, factored_again):
    n, calls, rng = DENSE + 5, [], np.random.default_rng(1)
    f = Counted(rng.normal(size=(n, n)) + n * np.eye(n), c * n)
    system = NewtonSystem(f, np.arange(n), np.arange(n))
    monkeypatch.setattr(newton, 'splu', lambda M, splu=newton.splu: calls.append(1) or splu(M))
    first = f.at(rng.normal(size=n))
    assert system.solve(np.zeros(n)) == pytest.approx(first, rel=1e-10)
    calls.clear()
    second = f.at(first + 0.5)
    assert system.solve(first) == pytest.approx(second, rel=1e-10)
    assert min(1, len(calls)) == factored_again
