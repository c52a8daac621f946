"""Inequalities that hold strictly: implied by others, or with a positive multiplier."""

import numpy as np
import pytest
from scipy import sparse

from pyomo_fesd.sensitivities.multipliers import implied, multipliers


def test_non_negative_values_whose_sum_is_zero_are_implied():
    # x + y == 0, x >= 0, y >= 0, z >= 0
    A = sparse.csr_matrix([[1.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    assert implied(A, np.array([False, True, True, True])).tolist() == [False, True, True, False]


def test_multipliers_of_redundant_inequalities_are_all_positive():
    # -x <= 0 twice, gradient 1: any split of the multiplier 1
    A, both = sparse.csr_matrix([[-1.0], [-2.0]]), np.array([True, True])
    lam, positive = multipliers(np.array([1.0]), A, both, 1.0)
    assert positive.all() and A.T @ lam == pytest.approx([-1.0])


def test_least_squares_with_a_wrong_sign_is_corrected():
    # gradient (1, 0): rows -x - y, -x + y and y; least squares may take a negative one
    A = sparse.csr_matrix([[-1.0, -1.0], [-1.0, 1.0], [0.0, 1.0]])
    lam, positive = multipliers(np.array([1.0, 0.0]), A, np.array([True, True, True]), 1.0)
    assert (lam >= 0).all() and positive.all()
    assert A.T @ lam == pytest.approx([-1.0, 0.0], abs=1e-6)


def test_a_zero_multiplier_is_not_positive_and_a_wrong_gradient_has_none():
    A, one = sparse.csr_matrix([[-1.0, 0.0]]), np.array([True])
    assert multipliers(np.array([1e-7, 0.0]), A, one, 1.0)[1].tolist() == [False]
    assert multipliers(np.array([0.0, 1.0]), A, one, 1.0) is None
    assert multipliers(np.array([-1.0, 0.0]), A, one, 1.0) is None
