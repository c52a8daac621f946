"""The search over bi-active pairs against all branches, each solved by scipy."""

from itertools import product

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import linprog

from pyomo_fesd.mpcc.nlp import Deadline
from pyomo_fesd.mpcc.subproblems import repeated_program
from pyomo_fesd.mpcc.subproblems.active_set import G_ZERO, H_ZERO
from pyomo_fesd.mpcc.subproblems.descent import Descent
from pyomo_fesd.mpcc.subproblems.linear_program import Program
from pyomo_fesd.mpcc.subproblems.lpec import LpecResult
from pyomo_fesd.mpcc.subproblems.pair_program import PairProgram
from pyomo_fesd.mpcc.subproblems.pair_search import PairSearch

ENOUGH = 1e-6


def search(program, pairs, matters=lambda value: False, deadline=None):
    descent, p = Descent(program, list), PairProgram(program, pairs)

    def branch(sides, answer):
        measured = descent.of(p.with_sides(sides)).proved(answer.y)
        return LpecResult(True, float(program.cost @ answer.d), answer.d, sides, pairs, measured)

    return PairSearch(p, descent, ENOUGH, matters, branch, {}, deadline or Deadline())


def value(program, sides):
    """The value of a branch."""
    high = PairProgram(program, len(sides)).upper_bounds(sides)
    at_high, at_low, A = np.isfinite(high), np.isfinite(program.low), program.A.toarray()
    rows, limits = np.vstack([A[at_high], -A[at_low]]), np.append(high[at_high], -program.low[at_low])
    return linprog(program.cost, rows, limits, bounds=list(zip(program.lower, program.upper))).fun


def independent(pairs, cost=-1.0):
    """min cost * sum z, z <= G, z <= H for each pair: 0 in every branch, and less where a pair is free."""
    eye, none = np.eye(pairs), np.zeros((pairs, pairs))
    rows = np.vstack(
        [np.hstack([eye, -eye, none]), np.hstack([eye, none, -eye]), np.hstack([none, eye, none]), np.hstack([none, none, eye])]
    )
    low = np.append(np.full(2 * pairs, -np.inf), np.zeros(2 * pairs))
    high = np.append(np.zeros(2 * pairs), np.full(2 * pairs, np.inf))
    all_of = np.ones(3 * pairs)
    return Program(
        np.append(np.full(pairs, cost), np.zeros(2 * pairs)), sparse.csr_matrix(rows), low, high, 0 * all_of, all_of, all_of
    )


def drawn(seed, pairs=5):
    """``independent`` pairs, with variables that descend in the branches of some sides only, or in none; all mixed and scaled."""
    random = np.random.default_rng(seed)
    program = independent(pairs)
    for _ in range(3):
        # at least one pair with both sides means: in no branch
        most = [(i, random.choice((G_ZERO, H_ZERO))) for i in random.choice(pairs, 3)]
        i = random.integers(pairs)
        most += [(i, G_ZERO), (i, H_ZERO)] if random.random() < 0.8 else []
        program = with_variable(program, pairs, most)
    n = len(program.cost)
    mix = np.eye(n) + 0.3 * np.triu(random.normal(size=(n, n)), 1) * (random.random((n, n)) < 0.2)
    scale = 10.0 ** random.uniform(-2, 2, n)
    A = sparse.csr_matrix(program.A.toarray() @ mix * scale)
    return Program(mix.T @ program.cost * scale, A, program.low, program.high, -1 / scale, 1 / scale, 1 / scale)


def with_variable(program, pairs, most):
    """The program with one more variable z, of cost -1, that is at most the other side of each of the given zero sides."""
    rows, cut, n = program.A.toarray(), program.A.shape[0] - 2 * pairs, len(program.cost)
    extra = np.zeros((len(most) + 1, n + 1))
    for row, (i, side) in zip(extra, most):
        row[-1], row[pairs + i + (pairs if side == G_ZERO else 0)] = 1.0, -1.0
    extra[-1, -1] = -1.0
    rows = np.hstack([rows, np.zeros((len(rows), 1))])
    A = sparse.csr_matrix(np.vstack([rows[:cut], extra, rows[cut:]]))
    low = np.concatenate([program.low[:cut], np.full(len(extra), -np.inf), program.low[cut:]])
    high = np.concatenate([program.high[:cut], np.zeros(len(extra)), program.high[cut:]])
    return Program(np.append(program.cost, -1.0), A, low, high, np.append(program.lower, 0.0), np.ones(n + 1), np.ones(n + 1))


@pytest.mark.parametrize('seed', range(60))
def test_it_finds_a_descent_where_a_branch_has_one_and_proves_that_there_is_none_elsewhere(seed):
    program = drawn(seed)
    values = {sides: value(program, np.array(sides)) for sides in product((G_ZERO, H_ZERO), repeat=5)}
    run = search(program, 5)
    found = run.run()
    assert not run.is_open
    if found is None:
        assert min(values.values()) > -1e-6
    else:
        assert found.value == pytest.approx(values[tuple(found.zero)], abs=1e-6)
        assert found.value < -1e-6


def test_the_random_programs_are_of_both_kinds():
    kinds = [search(drawn(seed), 5).run() is None for seed in range(60)]
    assert 10 < sum(kinds) < 50


def test_pairs_that_are_independent_take_a_program_each_and_not_one_for_each_combination(monkeypatch):
    calls, solve = [], repeated_program.RepeatedProgram._from_last_basis
    monkeypatch.setattr(
        repeated_program.RepeatedProgram, '_from_last_basis', lambda self, high: calls.append(1) or solve(self, high)
    )
    run = search(independent(40), 40)
    assert run.run() is None and not run.is_open
    assert len(calls) <= 4 * 40


def test_what_settles_pairs_together_does_not_hide_the_one_branch_that_descends():
    found = search(with_variable(independent(12), 12, [(0, H_ZERO), (1, G_ZERO)]), 12).run()
    assert found.value == pytest.approx(-1)
    assert found.zero[0] == H_ZERO and found.zero[1] == G_ZERO


def test_a_branch_that_highs_does_not_solve_leaves_the_search_open(monkeypatch):
    monkeypatch.setattr(repeated_program.RepeatedProgram, 'solve', lambda self, high: None)
    monkeypatch.setattr(repeated_program.RepeatedProgram, 'optimum', lambda self, high: None)
    run = search(independent(2), 2)
    assert run.run() is None and run.is_open


def test_without_time_the_search_is_open():
    run = search(independent(3), 3, deadline=Deadline.after(0.0))
    assert run.run() is None and run.is_open


def test_a_branch_whose_value_matters_is_kept_although_nothing_descends():
    program = independent(2, cost=0.0)
    run = search(program, 2, matters=lambda value: True)
    assert run.run() is None and not run.is_open
    assert len(run.others) == 4
