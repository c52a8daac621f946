"""The first 104 instances of the random study: nothing wrong, no false certificate, nothing refused; and a judge that bites."""

import numpy as np
import pytest
from benchmarks.random_mpcc.instances import KINDS, Instance, Units, generate
from benchmarks.random_mpcc.judge import CERTIFIED, FALSE, INFEASIBLE, RIGHT, UNBOUNDED, WRONG, Judge
from benchmarks.random_mpcc.run import solve

COUNT, CHUNKS = 104, 8


def toy(units=None):
    """min (x - 1)^2 + (y - 1)^2, x perp y."""

    def functions(w, exp, sin):
        return (w[0] - 1) ** 2 + (w[1] - 1) ** 2, [], [(w[0], w[1])]

    none = np.zeros(0)
    units = units or Units(np.ones(2), none)
    bounds = np.zeros(2), np.full(2, np.inf)
    return Instance('toy', 0, functions, *bounds, none, none, np.array([0.3, 0.4]), units, point=np.array([1.0, 0.0]))


@pytest.mark.parametrize(
    'outcome, w, verdict',
    [
        (CERTIFIED, (1.0, 0.0), RIGHT),
        (CERTIFIED, (0.0, 0.0), FALSE),
        (CERTIFIED, (0.5, 0.0), FALSE),
        (CERTIFIED, (0.5, 0.5), WRONG),
        (CERTIFIED, (np.nan, 0.0), WRONG),
        (INFEASIBLE, (0.0, 0.0), WRONG),
        (UNBOUNDED, (1e12, 0.0), WRONG),
    ],
)
def test_the_judge_knows_the_toy(outcome, w, verdict):
    assert Judge(toy()).verdict(outcome, np.array(w))[0] == verdict


def test_the_judge_looks_into_every_branch_of_an_infeasible_instance():
    seed = [*KINDS].index('infeasible')
    assert Judge(generate(seed)).verdict(INFEASIBLE, np.zeros(1))[0] == RIGHT


@pytest.mark.parametrize('chunk', range(CHUNKS))
def test_random_problems(chunk):
    rows = [solve(seed) for seed in range(chunk, COUNT, CHUNKS)]
    assert not [row for row in rows if row['verdict'] != RIGHT]
    assert max(row['nlps'] for row in rows) < 150
