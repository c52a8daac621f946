"""Linear programs in HiGHS: the answer, and the attempts where a method does not end."""

import os
import subprocess
import sys

import highspy
import numpy as np
import pytest
from scipy import sparse

from pyomo_fesd.mpcc.nlp import Deadline
from pyomo_fesd.mpcc.subproblems import linear_program
from pyomo_fesd.mpcc.subproblems.linear_program import Program, solve


def assignment(binaries=0):
    """min -sum c x over doubly stochastic matrices of order 3 in [0, 1]."""
    cost = -np.array([3.0, 1, 2, 2, 4, 1, 1, 2, 5])
    rows = sparse.csr_matrix(np.vstack([np.kron(np.eye(3), np.ones(3)), np.kron(np.ones(3), np.eye(3))]))
    return Program(cost, rows, np.ones(6), np.ones(6), np.zeros(9), np.ones(9), np.ones(9), binaries)


@pytest.mark.parametrize('binaries', [0, 9])
@pytest.mark.parametrize('iterations', [3, 0])
def test_a_simplex_method_that_does_not_end_costs_no_answer(monkeypatch, binaries, iterations):
    monkeypatch.setattr(linear_program, 'ITERATIONS', iterations)
    answer = solve(assignment(binaries), {}, Deadline())
    assert answer.d == pytest.approx(np.eye(3).ravel(), abs=1e-6)


def test_only_attempts_before_the_last_have_a_limit_and_binaries_skip_the_primal_method():
    relaxed, mixed = linear_program._attempts(assignment()), linear_program._attempts(assignment(9))
    limits = [attempt.get('simplex_iteration_limit') for attempt in relaxed]
    assert limits[-1] is None and set(limits[:-1]) == {linear_program.ITERATIONS * 15}
    assert len(mixed) == len(relaxed) - 1 and not any('simplex_iteration_limit' in attempt for attempt in mixed)


def knapsack(items=30, rows=20):
    """max c x, A x <= 6, x binary: not solved at the root."""
    random = np.random.default_rng(0)
    A, ones = sparse.csr_matrix(random.uniform(0, 1, (rows, items))), np.ones(items)
    return Program(-random.uniform(0, 1, items), A, np.full(rows, -np.inf), np.full(rows, items / 5), 0 * ones, ones, ones, items)


def highs_with(threads):
    """The answer of a HiGHS run of another tool in this thread."""
    highs = highspy.Highs()
    highs.setOptionValue('output_flag', False)
    highs.setOptionValue('threads', threads)
    return highs.run()


@pytest.fixture
def many_threads():
    """HiGHS has run with 3 threads, and can run with any number afterwards."""
    highspy.Highs.resetGlobalScheduler(True)
    highs_with(3)
    yield
    highspy.Highs.resetGlobalScheduler(True)


@pytest.mark.parametrize('options', [{}, {'threads': 2}])
def test_it_runs_after_another_tool_has_set_the_number_of_threads(many_threads, options):
    assert solve(knapsack(), options, Deadline()).d == pytest.approx(solve(knapsack(), {}, Deadline()).d)


@pytest.mark.parametrize('threads', [1, 3])
def test_after_it_another_tool_runs_with_its_number_of_threads(many_threads, threads):
    highspy.Highs.resetGlobalScheduler(True)
    highs_with(threads)
    solve(knapsack(), {}, Deadline())
    assert highs_with(threads) == highspy.HighsStatus.kOk


SOLVES = """
from tests.mpcc.subproblems.test_linear_program import Deadline, knapsack, solve

solve(knapsack(), {}, Deadline())
"""


def test_highs_writes_nothing():
    # in a process of its own, as HiGHS writes its licence once in a process
    done = subprocess.run([sys.executable, '-c', SOLVES], check=True, capture_output=True, text=True, timeout=100)
    assert (done.stdout, done.stderr) == ('', '')


FORKS = """
import faulthandler, os
from tests.mpcc.subproblems.test_linear_program import Deadline, highs_with, knapsack, solve

highs_with(3)
child = os.fork()
if child == 0:
    faulthandler.dump_traceback_later(50, exit=True)
    solve(knapsack(), {}, Deadline())
    os._exit(0)
raise SystemExit(os.waitpid(child, 0)[1])
"""


@pytest.mark.skipif(not hasattr(os, 'fork'), reason='no fork on this system')
def test_a_forked_process_solves_programs_too():
    # the worker threads of the other tool do not exist there; a process of its own has no others that hold locks
    subprocess.run([sys.executable, '-c', FORKS], check=True, timeout=100)
