"""A program that is solved again from the last basis, against the same one solved at once."""

from dataclasses import replace

import highspy
import numpy as np
import pytest
from scipy import sparse

from pyomo_fesd.mpcc.nlp import Deadline
from pyomo_fesd.mpcc.subproblems import repeated_program
from pyomo_fesd.mpcc.subproblems.descent import Descent
from pyomo_fesd.mpcc.subproblems.linear_program import Program, solve
from pyomo_fesd.mpcc.subproblems.repeated_program import RepeatedProgram


def drawn(seed, m=12, n=9):
    random = np.random.default_rng(seed)
    A, scale = random.normal(size=(m, n)), 10.0 ** random.uniform(-3, 3, n)
    return Program(random.normal(size=n) / scale, sparse.csr_matrix(A / scale), -np.ones(m), np.ones(m), -scale, scale, scale)


@pytest.mark.parametrize('seed', range(10))
def test_each_answer_is_that_of_a_program_of_its_own(seed):
    program, random = drawn(seed), np.random.default_rng(seed)
    repeated = RepeatedProgram(program, {}, Deadline())
    for _ in range(8):
        high = random.choice([0.0, 0.3, 1.0, np.inf], len(program.high))
        bounded = replace(program, high=high)
        value = program.cost @ solve(bounded, {}, Deadline()).d
        for answer in (repeated.solve(high), repeated.optimum(high)):
            assert program.cost @ answer.d == pytest.approx(value, abs=1e-7)
            assert Descent(bounded, list).least(answer.y) == pytest.approx(value, abs=1e-6)


def test_where_the_simplex_method_does_not_end_others_give_multipliers_that_prove_nearly_the_value(monkeypatch):
    monkeypatch.setattr(repeated_program, 'FIRST', 0.0)
    program = drawn(0)
    value = program.cost @ solve(program, {}, Deadline()).d
    repeated = RepeatedProgram(program, {}, Deadline())
    assert repeated.basis is None
    assert Descent(program, list).least(repeated.solve(program.high).y) == pytest.approx(value, abs=1e-3)
    assert program.cost @ repeated.optimum(program.high).d == pytest.approx(value, abs=1e-7)


class JustMissing:
    """HiGHS whose first run misses the tolerances by its own account."""

    def __init__(self, highs):
        self._highs, self._runs, self.strategies = highs, 0, []

    def __getattr__(self, name):
        return getattr(self._highs, name)

    def run(self):
        self._runs += 1
        self.strategies.append(self._highs.getOptionValue('simplex_strategy')[1])
        return self._highs.run()

    def getModelStatus(self):  # noqa: N802
        return highspy.HighsModelStatus.kUnknown if self._runs == 1 else self._highs.getModelStatus()


def test_where_the_dual_method_misses_the_tolerances_the_primal_one_goes_on_and_the_next_run_is_dual_again():
    program = drawn(0)
    repeated = RepeatedProgram(program, {}, Deadline())
    repeated._highs = missing = JustMissing(repeated._highs)
    value = program.cost @ solve(program, {}, Deadline()).d
    assert program.cost @ repeated.optimum(program.high).d == pytest.approx(value, abs=1e-7)
    repeated.solve(0.5 * program.high)
    assert missing.strategies == [repeated_program.DUAL, repeated_program.PRIMAL, repeated_program.DUAL]


@pytest.mark.parametrize('given', [{}, {'simplex_scale_strategy': 0}])
def test_an_optimum_of_a_large_program_is_one_with_scaling_too_unless_the_user_chooses(given, monkeypatch):
    monkeypatch.setattr(repeated_program, 'LARGE', 0)
    program, scalings = drawn(0), []
    real = repeated_program.run

    def run(highs):
        scalings.append(highs.getOptionValue('simplex_scale_strategy')[1])
        real(highs)

    monkeypatch.setattr(repeated_program, 'run', run)
    repeated = RepeatedProgram(program, given, Deadline())
    value = program.cost @ solve(program, {}, Deadline()).d
    for _ in range(2):
        assert program.cost @ repeated.optimum(program.high).d == pytest.approx(value, abs=1e-7)
    once = [repeated_program.UNSCALED] if given else [repeated_program.UNSCALED, repeated_program.SCALED]
    assert scalings == 2 * once
