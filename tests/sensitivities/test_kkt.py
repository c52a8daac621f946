"""The linear system, also where it is singular."""

import numpy as np
import pytest
from scipy import sparse

from pyomo_fesd.sensitivities.kkt import Kkt


def test_agrees_with_a_dense_solution():
    random = np.random.default_rng(0)
    H, A = np.diag(random.uniform(1, 1e3, 6)), random.normal(size=(3, 6))
    b, d = random.normal(size=(6, 2)), random.normal(size=(3, 2))
    answer = Kkt(sparse.csr_matrix(H), sparse.csr_matrix(A)).solve(b, d)
    exact = np.linalg.solve(np.block([[H, A.T], [A, np.zeros((3, 3))]]), np.vstack([b, d]))
    assert answer.exists.all()
    assert np.vstack([answer.x, answer.y]) == pytest.approx(exact, rel=1e-9, abs=1e-12)


def test_redundant_rows_do_no_harm_and_contradictions_show():
    A = sparse.csr_matrix([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    answer = Kkt(sparse.csr_matrix((2, 2)), A).solve(np.zeros((2, 2)), np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.1]]))
    assert answer.exists.tolist() == [True, False]
    assert answer.x[:, 0] == pytest.approx([1.0, 2.0])


def test_a_free_direction_is_outside_of_the_range():
    kkt = Kkt(sparse.csr_matrix((2, 2)), sparse.csr_matrix([[1.0, 1.0]]))
    answer = kkt.solve(np.array([[1.0, 1.0], [1.0, 0.0]]), np.zeros((1, 2)))
    assert answer.exists.tolist() == [True, False]


def test_without_rows():
    answer = Kkt(sparse.csr_matrix([[2.0]]), sparse.csr_matrix((0, 1))).solve(np.array([[1.0]]), np.zeros((0, 1)))
    assert answer.x[0, 0] == pytest.approx(0.5)
