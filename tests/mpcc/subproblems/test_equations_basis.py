"""The basis of equations of a linear program: which columns it names, and that the optimum is the same with it in fewer pivots."""

from dataclasses import replace

import highspy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from pyomo_fesd.mpcc.nlp import Deadline
from pyomo_fesd.mpcc.subproblems import repeated_program
from pyomo_fesd.mpcc.subproblems.descent import Descent
from pyomo_fesd.mpcc.subproblems.equations_basis import EQUATION, equations_basis
from pyomo_fesd.mpcc.subproblems.linear_program import Program, solve
from pyomo_fesd.mpcc.subproblems.repeated_program import RepeatedProgram

BASIC = highspy.HighsBasisStatus.kBasic


def chain(n, seed=0, left=0.0):
    """n steps of x_i = a_i x_(i-1) + u_i with a cost of all x and u; equations leave their sides ``left`` apart."""
    random = np.random.default_rng(seed)
    steps = sparse.diags([np.ones(n), -random.uniform(0.5, 1.0, n - 1)], [0, -1])
    A = sparse.hstack([steps, -sparse.identity(n)], format='csr')
    reach = np.ones(2 * n)
    return Program(random.normal(size=2 * n), A, np.zeros(n), np.full(n, left), -reach, reach, reach)


def basic(states):
    return np.array([state == BASIC for state in states])


@pytest.mark.parametrize('left', [0.0, EQUATION / 2])
def test_each_equation_determines_a_column(left):
    p = chain(20, left=left).equilibrated()[0]
    basis = equations_basis(p, p.high)
    assert not basic(basis.row_status).any() and np.count_nonzero(basic(basis.col_status)) == 20


def test_neither_inequalities_nor_fixed_columns_nor_small_entries_are_pivots():
    A = sparse.csr_matrix([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 1e-3, 0.0], [1e-3, 0.0, 0.0, 1.0]])
    fixed, reach = np.array([0.0, 0.0, 1.0, 1.0]), np.ones(4)
    p = Program(np.ones(4), A, np.zeros(3), np.array([1.0, 0.0, 0.0]), -fixed, fixed, reach)
    basis = equations_basis(p, p.high)
    # of the second row the large entry is that of a fixed column
    assert basic(basis.row_status).tolist() == [True, True, False]
    assert basic(basis.col_status).tolist() == [False, False, False, True]


@given(seed=st.integers(0, 10**6), m=st.integers(1, 30), n=st.integers(1, 30))
def test_there_are_as_many_basic_rows_and_columns_as_rows(seed, m, n):
    random = np.random.default_rng(seed)
    A = sparse.random(m, n, 0.3, format='csr', random_state=random)
    high = random.choice([0.0, 1.0, np.inf], m)
    p = Program(random.normal(size=n), A, np.zeros(m), high, -np.ones(n), np.ones(n), np.ones(n)).equilibrated()[0]
    basis = equations_basis(p, p.high)
    assert np.count_nonzero(basic(basis.row_status)) + np.count_nonzero(basic(basis.col_status)) == m


@pytest.mark.parametrize('seed', range(5))
def test_a_large_program_has_the_same_optimum_in_fewer_pivots(seed, monkeypatch):
    program = chain(repeated_program.LARGE, seed)
    value, pivots = program.cost @ solve(program, {}, Deadline()).d, []
    for large in (repeated_program.LARGE, np.inf):
        monkeypatch.setattr(repeated_program, 'LARGE', large)
        repeated = RepeatedProgram(program, {}, Deadline())
        answer = repeated.optimum(program.high)
        assert program.cost @ answer.d == pytest.approx(value, rel=1e-7)
        assert Descent(program, list).least(answer.y) == pytest.approx(value, rel=1e-6)
        pivots.append(repeated._highs.getInfo().simplex_iteration_count)
    assert pivots[0] < pivots[1]


def test_a_singular_basis_costs_time_only():
    program = chain(repeated_program.LARGE)
    # each equation twice: the matching names columns that depend on each other
    A = sparse.vstack([program.A, 2.0 * program.A], format='csr')
    twice = replace(program, A=A, low=np.tile(program.low, 2), high=np.tile(program.high, 2))
    answer = RepeatedProgram(twice, {}, Deadline()).optimum(twice.high)
    assert program.cost @ answer.d == pytest.approx(program.cost @ solve(program, {}, Deadline()).d, rel=1e-7)
