"""Estimate the error of a solution by comparison with coarser ones (Richardson).

With the numbers of elements N_1 < N_2 < ... and the difference E_k between the solutions k - 1 and k,

    e_k = 4 E_k / ((N_k/N_{k-1})**p - 1)

is the error of the finer one, with a safety factor 4 before the asymptotic range.  The order p is observed: it solves

    (N_{k-2}**-p - N_{k-1}**-p)/(N_{k-1}**-p - N_k**-p) = E_{k-1}/E_k,

is never taken larger than that of the scheme, nor than log(E_{k-1}/E_k)/log(N_{k-1}/N_{k-2}), and is 1 with two rounds only.
Rounds with different sequences of active sets cannot be compared: the coarse one does not resemble the solution yet.

N is the *effective* number of elements (``element_density``).  A piece that has the same elements in both rounds makes no
difference; its error does not show in E, and

    c_K sum_n s_n**(p+1)

over such pieces is added, with the error constant c_K of the scheme for x' = x.

Does not apply: to errors that no grid shows, such as a local minimum instead of the global one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from math import factorial, inf

import numpy as np
from scipy.interpolate import KroghInterpolator
from scipy.optimize import brentq

from pyomo_fesd.core import Grid
from pyomo_fesd.refinement.dense_output import Piece, RoundSolution
from pyomo_fesd.refinement.element_density import scales

#: Safety factor before the asymptotic range.
SAFETY = 4.0
#: A piece has the same elements as before if they are longer than this part of those.
SAME = 0.9
#: The least observed order that is accepted.
LEAST_ORDER = 0.5


@dataclass(frozen=True)
class Difference:
    """Largest differences of two rounds, or errors; relative to max(1, |value|) or to the nominal size."""

    states: float
    switches: float
    objective: float
    quantities: float

    def __mul__(self, factor: float) -> Difference:
        return Difference(*(factor * d for d in astuple(self)))

    def __add__(self, more: float) -> Difference:
        return Difference(*(d + more for d in astuple(self)))

    @property
    def largest(self) -> float:
        """The difference of the quantities that the user has named, else the largest of all others."""
        if not np.isnan(self.quantities):
            return self.quantities
        return max((d for d in (self.states, self.switches, self.objective) if not np.isnan(d)), default=np.nan)


def difference(coarse: RoundSolution, fine: RoundSolution) -> Difference | None:
    """Return the differences of two solutions; None where they cannot be compared.

    States are compared at the boundaries of the coarse elements, where collocation has its full order, each at the same relative
    time of its piece.
    """
    if [(p.stage, p.modes) for p in coarse.pieces] != [(p.stage, p.modes) for p in fine.pieces]:
        return None
    pairs = list(zip(coarse.pieces, fine.pieces))
    states = [_state_difference(coarse, fine, name, c, f) / size for name, size in fine.states.items() for c, f in pairs]
    horizon = fine.pieces[-1].nodes[-1] - fine.pieces[0].nodes[0]
    switches = [_relative(c.nodes[0], f.nodes[0], min(1.0, horizon)) for c, f in pairs]
    quantities = [_relative(a, b) for a, b in zip(coarse.quantities, fine.quantities)]
    return Difference(
        max(states, default=0.0), max(switches), _relative(coarse.objective, fine.objective), max(quantities, default=np.nan)
    )


def _relative(a, b, least=1.0):
    return abs(a - b) / max(least, abs(b))


def _state_difference(coarse, fine, name, c, f):
    """The largest difference of a state at the nodes of a coarse piece c, each at the same relative time of the fine piece f."""
    relative = (c.nodes - c.nodes[0]) / c.length
    times, values = f.nodes[0] + relative[1:-1] * f.length, coarse.at_nodes(name, c)
    ends = np.abs(values[[0, -1]] - fine.at_nodes(name, f)[[0, -1]])
    found = [np.abs(inner - values[1:-1]) for inner in _inside(fine, name, f, times)]
    # each interpolation has an error of its own: slopes are inexact where the system is stiff
    return max(*ends, *np.min(found, axis=0))


def _inside(solution, name, piece, times):
    """A state at inner times of a piece by several interpolations: in an element, through nodes, through nodes with slopes."""
    nodes, values, K = piece.nodes, solution.at_nodes(name, piece), len(solution.grid.tau)
    slopes = solution.slopes_at_nodes(name, piece)
    yield solution.inside(name, piece, times)
    if len(nodes) > 2 * K:
        yield np.array([_interpolate(nodes, [[v] for v in values], t, 2 * K + 1) for t in times])
    if len(nodes) > K and slopes is not None:
        data = [[values[0]], *([v, slope] for v, slope in zip(values[1:], slopes))]
        yield np.array([_interpolate(nodes, data, t, K + 1) for t in times])


def _interpolate(nodes, data, t, around):
    """Value at t of the polynomial through the ``around`` nodes next to it, with their values and, if given, slopes."""
    first = int(np.clip(np.searchsorted(nodes, t) - around // 2, 0, len(nodes) - around))
    data = data[first : first + around]
    repeated = np.repeat(nodes[first : first + around], [len(d) for d in data])
    return float(KroghInterpolator(repeated, np.concatenate(data))(t))


def observed_order(numbers: Sequence[float], largest: Sequence[float], order: int) -> float:
    """Return p from three effective numbers and the two differences between them, between ``LEAST_ORDER`` and ``order``."""
    if not all(largest) or numbers[2] <= numbers[1] or numbers[1] <= numbers[0]:
        return LEAST_ORDER

    def mismatch(p):
        a, b, c = (n**-p for n in np.divide(numbers, numbers[0]))
        return np.log((a - b) / (b - c)) - np.log(largest[0] / largest[1])

    # E_k is at most about the error of solution k - 1; where the differences do not add up, as in a layer that no grid resolves
    # yet, the equation for p overestimates it
    most = float(np.clip(np.log(largest[0] / largest[1]) / np.log(numbers[1] / numbers[0]), LEAST_ORDER, order))
    if mismatch(LEAST_ORDER) >= 0:
        return LEAST_ORDER
    return most if mismatch(most) <= 0 else brentq(mismatch, LEAST_ORDER, most)


def error(numbers: Sequence[float], found: Difference, p: float) -> Difference:
    """Return the estimated error of the finest solution, from effective numbers and ``found`` between the last two rounds."""
    ratio = (numbers[-1] / numbers[-2]) ** p
    return found * (SAFETY / (ratio - 1) if ratio > 1 else inf)


def error_without_difference(coarse: RoundSolution, fine: RoundSolution, order: int) -> float:
    """Return the error of pieces that have the same elements in both rounds, by the local scales alone."""
    pairs = zip(coarse.pieces, fine.pieces)
    same = [f for c, f in pairs if np.max(np.diff(f.nodes)) > SAME * np.max(np.diff(c.nodes))]
    return error_by_scales(fine, same, order)


def error_by_scales(solution: RoundSolution, pieces: Iterable[Piece], order: int) -> float:
    """Return the error of some pieces by their local scales alone."""
    return error_constant(solution.grid) * sum(float(np.sum(scales(solution, p) ** (order + 1))) for p in pieces)


def error_constant(grid: Grid) -> float:
    """Return c_K of the scheme."""
    K = len(grid.tau)
    if grid.right_is_collocated:
        return factorial(K) * factorial(K - 1) / (factorial(2 * K - 1) * factorial(2 * K))
    return factorial(K) ** 2 / (factorial(2 * K) * factorial(2 * K + 1))
