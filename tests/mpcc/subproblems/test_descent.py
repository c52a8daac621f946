"""The bounds that multipliers prove, against the value of the linear program."""

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import linprog

from pyomo_fesd.mpcc.subproblems.descent import Descent
from pyomo_fesd.mpcc.subproblems.linear_program import Program


def drawn(seed):
    """A random program with 0 among its points, its value and its multipliers (positive at lower bounds)."""
    random = np.random.default_rng(seed)
    m, n = 4, 6
    cost, A = random.normal(size=n), random.normal(size=(m, n)) * (random.random((m, n)) < 0.6)
    low, high = -random.choice([0.0, 0.5, np.inf], m), random.choice([0.0, 0.5, np.inf], m)
    reach = random.uniform(0.1, 2, n)
    lower, upper = -reach * random.choice([0, 1], n), reach
    at_high, at_low = np.isfinite(high), np.isfinite(low)
    rows, limits = np.vstack([A[at_high], -A[at_low]]), np.append(high[at_high], -low[at_low])
    found = linprog(cost, rows, limits, bounds=list(zip(lower, upper)))
    y = np.zeros(m)
    marginals = found.ineqlin.marginals
    y[at_high] += marginals[: at_high.sum()]
    y[at_low] -= marginals[at_high.sum() :]
    return Program(cost, sparse.csr_matrix(A), low, high, lower, upper, reach), found.fun, y


@pytest.mark.parametrize('seed', range(20))
def test_multipliers_bound_the_value_from_below_and_those_of_a_solution_are_exact(seed):
    program, value, y = drawn(seed)
    descent, random = Descent(program, list), np.random.default_rng(seed)
    assert descent.least(y) == pytest.approx(value, abs=1e-8)
    assert all(descent.least(y + random.normal(size=len(y))) <= value + 1e-8 for _ in range(20))


def test_the_factor_of_the_objective_does_not_change_the_relative_descent():
    program, _, y = drawn(3)
    scaled = Program(1e6 * program.cost, *list(vars(program).values())[1:7])
    assert Descent(scaled, list).proved(1e6 * y) == pytest.approx(Descent(program, list).proved(y))
    assert Descent(program, list).proved(y) > 0


def test_a_descent_is_negligible_beside_the_largest_term_or_its_changes():
    program, _, _ = drawn(3)
    largest = float(np.max(np.abs(program.cost) * program.reach))
    changing = Descent(program, lambda: [(1e3 * program.cost, lambda y: 0.0 * program.cost)])
    assert Descent(program, list).negligible(-0.9e-8 * largest)
    assert not Descent(program, list).negligible(-1.1e-8 * largest)
    assert changing.negligible(-0.9e-5 * largest)
    assert not changing.negligible(-1.1e-5 * largest)


@pytest.mark.parametrize('seed', range(20))
def test_what_is_proved_of_sums_holds_for_each_of_them(seed):
    program, _, y = drawn(seed)
    random = np.random.default_rng(seed)
    turned = random.normal(size=(len(program.cost), len(y)))
    descent = Descent(program, lambda: [(0.1 * program.cost, lambda y: turned @ y)])
    steps = [0.3 * random.normal(size=len(y)) * (random.random(len(y)) < 0.5) for _ in range(3)]
    proved, least = descent.proved_of_sums(y, steps, np.zeros(len(y)))
    for chosen in range(8):
        of_sum = y + sum(step for k, step in enumerate(steps) if chosen >> k & 1)
        assert descent.proved(of_sum) <= proved + 1e-12
        assert descent.least(of_sum) >= least - 1e-12
    assert descent.proved_of_sums(y, [], np.zeros(len(y))) == pytest.approx((descent.proved(y), descent.least(y)))
