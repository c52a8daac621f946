"""How the error depends on the elements, and how many of them each control stage gets.

The local error of an element is in proportion to s_n**(p+1), with its local scale

    s_n = (h_n**(K+1) |x^(K+1)| / |x|)**(1/(K+1))

from the differences of the K-th derivatives of the collocation polynomials (as in COLSYS).  Inside a smooth piece elements are
equal (eq. 13) and s_n = D h_n, with the density D of the piece.  So rounds are measured by

    M = sum_n (D_j h_n)**(p+1),   n in piece j;      N = M**(-1/p)

the *effective* number of elements: errors fall like N**-p, and N is in proportion to the number of elements if all pieces have more
of them.  A piece between two switches that is shorter than an element remains one element until the others are as short.

Source: U. Ascher, J. Christiansen and R. D. Russell, Collocation software for boundary-value ODEs, ACM TOMS 7, 1981.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial

import numpy as np

from pyomo_fesd.core import interpolation_weights
from pyomo_fesd.refinement.dense_output import Piece, RoundSolution

#: Least and largest growth from one round to the next: of the effective number, of the number.
GROWTH = (1.25, 4.0)
#: Least local scale of a piece, as a part of the largest: smaller ones are round-off, or chance.
LEAST_SCALE = 0.02
#: Margin of the growth, as numbers are whole and switches move.
MARGIN = 1.1
#: Elements that one step of the search adds to a control stage, as a part of its elements.
STEP = 0.05


@dataclass(frozen=True)
class DensePiece:
    """A smooth piece: the position of its control stage (from 0), its length, the density D."""

    stage: int
    length: float
    density: float


def densities(solution: RoundSolution, order: int) -> list[DensePiece]:
    """Return the pieces of a solution with their densities."""
    mean = np.array([np.mean(scales(solution, p) ** (order + 1)) ** (1 / (order + 1)) for p in solution.pieces])
    mean = np.maximum(mean, LEAST_SCALE * mean.max()) if mean.max() > 0 else np.ones(len(mean))
    lengths = np.array([p.length for p in solution.pieces])
    positions = {stage: k for k, stage in enumerate(solution.grid.stages)}
    found = mean * [len(p.elements) for p in solution.pieces] / lengths
    return [DensePiece(positions[p.stage], float(length), float(D)) for p, length, D in zip(solution.pieces, lengths, found)]


def scales(solution: RoundSolution, piece: Piece) -> np.ndarray:
    """Return the local scales s_n of the elements of a piece, shape (elements,)."""
    K, h, largest = len(solution.grid.tau), np.diff(piece.nodes), np.zeros(len(piece.elements))
    for name, size in solution.states.items():
        top = np.array([_leading(*solution.polynomial(name, e)) for e in piece.elements]) * factorial(K) / h**K
        if len(top) == 1:
            # without a neighbour, the K-th derivative itself
            scale = (h**K * np.abs(top) / size) ** (1 / K)
        else:
            between = np.abs(np.diff(top)) / ((h[1:] + h[:-1]) / 2)
            scale = (h ** (K + 1) * np.maximum([*between, 0], [0, *between]) / size) ** (1 / (K + 1))
        largest = np.fmax(largest, scale)
    return largest


def _leading(tau, values):
    """The coefficient of tau**K."""
    return interpolation_weights(tau, np.eye(len(tau))[-1]) @ values


def effective_number(solution: RoundSolution, pieces: Sequence[DensePiece], order: int) -> float:
    """Return N of a solution, with the densities of one that it can be compared with."""
    M = sum(np.sum((dense.density * np.diff(p.nodes)) ** (order + 1)) for p, dense in zip(solution.pieces, pieces))
    return float(M ** (-1 / order))


def expected(numbers: Sequence[float], pieces: Sequence[DensePiece], order: int) -> np.ndarray:
    """Return the contribution of each control stage to M, for numbers of elements without a solution yet."""
    lengths, M = np.zeros(len(numbers)), np.zeros(len(numbers))
    for dense in pieces:
        lengths[dense.stage] += dense.length
    for dense in pieces:
        h = min(lengths[dense.stage] / numbers[dense.stage], dense.length)
        M[dense.stage] += dense.length / h * (dense.density * h) ** (order + 1)
    return M


def next_numbers(numbers: Sequence[int], pieces: Sequence[DensePiece], order: int, factor: float, most: Sequence[int]) -> list[int]:
    """Return numbers of elements that are effectively ``factor`` times as many, each at least as now and at most ``most``."""
    factor = float(np.clip(factor * MARGIN, *GROWTH))
    found, M, full = np.array(numbers), expected(numbers, pieces, order), np.array(most)
    enough = sum(M) * factor**-order
    while sum(M) > enough and sum(found) < GROWTH[1] * sum(numbers) and np.any(found < full):
        # where one more element reduces the error most
        stage = int(np.argmax(np.where(found < full, M / found, -1.0)))
        found[stage] = min(full[stage], found[stage] + max(1, int(STEP * found[stage])))
        M = expected(found, pieces, order)
    return [int(n) for n in found]
