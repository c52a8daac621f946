"""What the rounds so far say of the error of the last one, and of the numbers of elements that the next one should have."""

from dataclasses import dataclass
from math import nan

from pyomo_fesd.accuracy.estimate import Difference, difference, error, observed_order, unseen
from pyomo_fesd.accuracy.placing import densities, effective, next_numbers

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
    solutions, numbers = [r.solution for r in rounds[-3:]], rounds[-1].numbers
    pieces = densities(solutions[-1], scheme)
    if len(rounds) == 1:
        return Judgement(UNKNOWN, nan, next_numbers(numbers, pieces, scheme, DOUBLE, most))
    found = [difference(a, b) for a, b in zip(solutions, solutions[1:])]
    sizes = [effective(s, pieces, scheme) for s in solutions]
    observed = observed_order(sizes, [d.largest for d in found], scheme) if len(solutions) == 3 else nan
    estimate = error(sizes, found[-1], observed if len(solutions) == 3 else 1.0) + unseen(*solutions[-2:], scheme)
    # to go on with, the order of the scheme is expected, unless what is observed is far from it
    order = observed if observed < scheme / 2 else scheme
    ahead = error(sizes, found[-1], order) + unseen(*solutions[-2:], scheme)
    factor = (ahead.largest / tolerance) ** (1 / order)
    return Judgement(estimate, observed, next_numbers(numbers, pieces, scheme, factor, most))
