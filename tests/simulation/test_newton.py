"""Steps of Newton's method: dense and sparse methods agree, and a singular matrix gives none."""

from types import SimpleNamespace

import numpy as np
import pytest

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
