"""Assess the rounds so far: the error of the last one, and the numbers of elements of the next one."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

from pyomo.opt import SolverResults

from pyomo_fesd.refinement.dense_output import RoundSolution
from pyomo_fesd.refinement.element_density import densities, effective_number, next_numbers
from pyomo_fesd.refinement.error_estimate import (
    Difference,
    difference,
    error,
    error_by_scales,
    error_without_difference,
    observed_order,
)
from pyomo_fesd.refinement.mesh import Mesh

#: Growth after the first round, when no error is known.
DOUBLE = 2.0
#: Where local scales on a mesh with fixed points promise an error so many times below the tolerance, the next round grows least.
SURE = 10.0
UNKNOWN = Difference(nan, nan, nan, nan)


@dataclass(frozen=True)
class Round:
    """The mesh, the solution on it, all values, and the results of the solver, if any."""

    mesh: Mesh
    solution: RoundSolution
    values: list[tuple] = ()
    results: SolverResults | None = None


@dataclass(frozen=True)
class Assessment:
    """The estimated error, the observed order (nan before the third round), and the next numbers of elements."""

    error: Difference
    order: float
    following: list[int]


def comparable(a: Round, b: Round) -> bool:
    """Return whether the sequences of active sets of two rounds are the same."""
    return difference(a.solution, b.solution) is not None


def assess(rounds: Sequence[Round], order: int, tolerance: float) -> Assessment:
    """Assess rounds of which each can be compared with the one before, for a scheme of this ``order``."""
    solutions, mesh = [r.solution for r in rounds[-3:]], rounds[-1].mesh
    numbers, most = mesh.numbers, mesh.most(len(solutions[-1].grid.tau))
    pieces = densities(solutions[-1], order)
    if len(rounds) == 1:
        fine = mesh.points and SURE * error_by_scales(solutions[-1], solutions[-1].pieces, order) <= tolerance
        return Assessment(UNKNOWN, nan, next_numbers(numbers, pieces, order, 1.0 if fine else DOUBLE, most))
    found = [difference(a, b) for a, b in zip(solutions, solutions[1:])]
    sizes = [effective_number(s, pieces, order) for s in solutions]
    observed = observed_order(sizes, [d.largest for d in found], order) if len(solutions) == 3 else nan
    unseen = error_without_difference(*solutions[-2:], order)
    estimate = error(sizes, found[-1], observed if len(solutions) == 3 else 1.0) + unseen
    # the next round assumes the order of the scheme, unless the observed one is far from it
    assumed = observed if observed < order / 2 else order
    ahead = error(sizes, found[-1], assumed) + unseen
    factor = (ahead.largest / tolerance) ** (1 / assumed)
    return Assessment(estimate, observed, next_numbers(numbers, pieces, order, factor, most))
