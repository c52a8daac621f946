"""What the rounds so far say of the error of the last one, and of the numbers of elements that the next one should have."""

from dataclasses import dataclass
from math import nan

from pyomo_fesd.accuracy.estimate import Difference, difference, error, observed_order
from pyomo_fesd.accuracy.placing import effective, next_numbers, weights

#: Growth where nothing tells how much is needed.
DOUBLE = 2.0
UNKNOWN = Difference(nan, nan, nan, nan)


@dataclass(frozen=True)
class Round:
    """Numbers of elements of the control stages, and the ``Solution`` on them."""

    numbers: list
    solution: object


@dataclass(frozen=True)
class Judgement:
    """The estimated error (a ``Difference``), the observed order (nan if not yet), and the next numbers of elements."""

    error: Difference
    order: float
    following: list


def comparable(a, b):
    """Whether the active sets of two rounds follow each other in the same way."""
    return difference(a.solution, b.solution) is not None


def judge(rounds, scheme, tolerance, most):
    """Judge rounds of which each can be compared with the one before.

    Parameters
    ----------
    rounds : list of Round
    scheme : int
        its order
    tolerance : float
    most : list of int
        largest numbers of elements of the control stages
    """
    numbers, stages = rounds[-1].numbers, weights(rounds[-1].solution, scheme)
    if len(rounds) == 1:
        return Judgement(UNKNOWN, nan, next_numbers(numbers, stages, scheme, DOUBLE, most))
    recent = rounds[-3:]
    found = [difference(a.solution, b.solution) for a, b in zip(recent, recent[1:])]
    sizes = [effective(r.numbers, stages, scheme) for r in recent]
    order = observed_order(sizes, [d.largest for d in found], scheme) if len(recent) == 3 else nan
    estimate = error(sizes, found[-1], order if len(recent) == 3 else 1.0)
    # what is not observed yet is expected of the scheme, to go on with
    expected = order if len(recent) == 3 else scheme
    factor = (error(sizes, found[-1], expected).largest / tolerance) ** (1 / expected)
    return Judgement(estimate, order, next_numbers(numbers, stages, scheme, factor, most))
