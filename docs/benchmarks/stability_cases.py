"""What a case is, and how an answer is judged from outside."""

from dataclasses import dataclass, replace

import numpy as np
import stability_methods as methods

RADAU, GAUSS = 'LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE'
#: An answer within TOLERANCE of the exact one (relative to the scale of each quantity) is right, within NEAR not far off.
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
        number of the start
    system : System
    looks : function (values) -> str, or None
        what a wrong answer looks like
    measure : function (values) -> values that are compared; None: the states
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

    #: whether nothing but a refusal is right
    without_answer = False

    def methods(self):
        """The names of the methods that can state it."""
        free = self.system.free or self.system.u
        return [name for name in methods.METHODS if not (free and name == 'simulate')]

    def run(self, method, limit):
        """The outcome of one method; None if it cannot state the case."""
        return methods.METHODS[method](self.system, self, limit)

    def error(self, values):
        """The largest relative error."""
        found, answer = (self.measure(values) if self.measure else values), self.system.answer
        scale = self.system.scale or [max(1.0, abs(a)) for a in answer if a is not None]
        pairs = [(f, a) for f, a in zip(found, answer) if a is not None]
        errors = [abs(f - a) / s for (f, a), s in zip(pairs, scale)]
        return max(errors) if np.all(np.isfinite(errors)) else np.inf


@dataclass(frozen=True)
class Sensitivity(Case):
    """A derivative of the end with respect to the start, from two runs beside one another."""

    step: float = 1e-3

    def run(self, method, limit):
        """Both runs as one."""
        both = [replace(self.system, x0=(self.system.x0[0] + d, *self.system.x0[1:])) for d in (-self.step, self.step)]
        low, high = (methods.METHODS[method](s, self, limit) for s in both)
        if low is None or high is None:
            return low or high
        values = None
        if low.values and high.values:
            values = [(b - a) / (2 * self.step) for a, b in zip(low.values, high.values)]
        return methods.Outcome(low.solved and high.solved, values, high.said, low.warned or high.warned)


@dataclass(frozen=True)
class Ambiguous(Case):
    """A system with several solutions from its start: right is who says so, and shows one of them."""

    def error(self, values):
        """Not to be told from values."""
        return 0.0


def judge(case, outcome):
    """``(class, error, what it looks like)`` of an outcome."""
    if isinstance(case, Ambiguous):
        one = outcome.solved and outcome.values is not None
        return (RIGHT if one and outcome.warned else WRONG if one else REFUSED), np.nan, 'one of many solutions, without a word'
    if case.without_answer:
        return (WRONG, np.inf, 'a solution where there is none') if outcome.solved else (RIGHT, np.nan, '')
    error = case.error(outcome.values) if outcome.values is not None else np.nan
    if not outcome.solved:
        return REFUSED, error, 'the right answer, not certified' if error <= TOLERANCE else ''
    if error <= TOLERANCE:
        return RIGHT, error, ''
    looks = case.looks(outcome.values) if case.looks else _distance(error)
    if outcome.warned:
        return REFUSED, error, looks
    return (NEARLY if error <= NEAR else WRONG), error, looks


def _distance(error):
    for bound, words in ((1e-2, 'off by less than 1 %'), (0.1, 'off by 1 to 10 %'), (1.0, 'off by 10 to 100 %')):
        if error <= bound:
            return words
    return 'off by more than 100 %'
