"""Cases of the stability study, and the classification of outcomes by known answers."""

from dataclasses import dataclass, replace

import numpy as np
from benchmarks.stability import methods

RADAU, GAUSS = 'LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE'
#: Errors up to TOLERANCE (relative to the scale of each quantity) count as right, up to NEAR as nearly right.
TOLERANCE, NEAR = 1e-3, 1e-2
RIGHT, REFUSED, NEARLY, WRONG = 'right', 'refused', 'silently within 1 %', 'silently wrong'
CLASSES = (RIGHT, REFUSED, NEARLY, WRONG)


@dataclass(frozen=True)
class Case:
    """One system with one grid.

    Attributes
    ----------
    family, name : str
    seed : int
        number of the random start
    system : System
    looks : function (values) -> str, or None
        description of a wrong answer
    measure : function (values) -> list, or None
        quantities to compare; None: the states
    """

    family: str
    name: str
    seed: int
    system: object
    nfe: int = 20
    ncp: int = 2
    scheme: str = RADAU
    looks: object = None
    measure: object = None

    #: whether only a refusal is right
    without_answer = False

    def methods(self):
        """Names of the methods that can state the case."""
        free = self.system.free or self.system.u
        return [name for name in methods.METHODS if not (free and name == 'simulate')]

    def run(self, method, limit):
        """Outcome of one method; None if it cannot state the case."""
        return methods.METHODS[method](self.system, self, limit)

    def error(self, values):
        """Largest relative error."""
        found, answer = (self.measure(values) if self.measure else values), self.system.answer
        scale = self.system.scale or [max(1.0, abs(a)) for a in answer if a is not None]
        pairs = [(f, a) for f, a in zip(found, answer) if a is not None]
        errors = [abs(f - a) / s for (f, a), s in zip(pairs, scale)]
        return max(errors) if np.all(np.isfinite(errors)) else np.inf


@dataclass(frozen=True)
class Sensitivity(Case):
    """A derivative of the end state with respect to the initial state, by a difference quotient of two runs."""

    step: float = 1e-3

    def run(self, method, limit):
        """Outcome of both runs."""
        low, high = (self._run_from(self.system.x0[0] + step, method, limit) for step in (-self.step, self.step))
        if low is None or high is None:
            return low or high
        values = None
        if low.values and high.values:
            values = [(b - a) / (2 * self.step) for a, b in zip(low.values, high.values)]
        return methods.Outcome(low.solved and high.solved, values, high.said, low.warned or high.warned)

    def _run_from(self, start, method, limit):
        system = replace(self.system, x0=(start, *self.system.x0[1:]))
        return methods.METHODS[method](system, self, limit)


@dataclass(frozen=True)
class Ambiguous(Case):
    """A system with several solutions from its initial state; right is one of them with a warning."""


def judge(case, outcome):
    """``(class, error, description of a wrong answer)`` of an outcome."""
    if isinstance(case, Ambiguous):
        return _judge_ambiguous(outcome)
    if case.without_answer:
        return (WRONG, np.inf, 'a solution where there is none') if outcome.solved else (RIGHT, np.nan, '')
    error = case.error(outcome.values) if outcome.values is not None else np.nan
    if not outcome.solved:
        return REFUSED, error, 'the right answer, not certified' if error <= TOLERANCE else ''
    return (RIGHT, error, '') if error <= TOLERANCE else _judge_claimed(case, outcome, error)


def _judge_claimed(case, outcome, error):
    """Class of a wrong answer with a claim of success."""
    looks = case.looks(outcome.values) if case.looks else _distance(error)
    return (REFUSED if outcome.warned else NEARLY if error <= NEAR else WRONG), error, looks


def _judge_ambiguous(outcome):
    one = outcome.solved and outcome.values is not None
    return (RIGHT if one and outcome.warned else WRONG if one else REFUSED), np.nan, 'one of many solutions, without a word'


def _distance(error):
    for bound, words in ((1e-2, 'off by less than 1 %'), (0.1, 'off by 1 to 10 %'), (1.0, 'off by 10 to 100 %')):
        if error <= bound:
            return words
    return 'off by more than 100 %'
