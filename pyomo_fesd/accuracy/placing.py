"""How the error depends on the elements, and how many of them each control stage gets.

The local error of an element is in proportion to theta_n**(p+1), with its local scale

    theta_n = (h_n**(K+1) |x^(K+1)| / |x|)**(1/(K+1))

from the differences of the K-th derivatives of the collocation polynomials (as in COLSYS).  Inside a smooth piece elements are
equal (eq. 13) and theta_n = D h_n, with the density D of the piece.  So rounds are measured by

    M = sum_n (D_j h_n)**(p+1),   n in piece j;      N = M**(-1/p)

the *effective* number of elements: errors fall like N**-p, and N is in proportion to the number of elements if all pieces have more
of them.  A piece between two switches that is shorter than an element remains one element until the others are as short.

Source: U. Ascher, J. Christiansen and R. D. Russell, Collocation software for boundary-value ODEs, ACM TOMS 7, 1981.
"""

from dataclasses import dataclass
from math import factorial

import numpy as np

from pyomo_fesd.elements.grid import LABEL_RESOLUTION

#: Least and largest growth from one round to the next: of the effective number, of the number.
GROWTH = (1.25, 4.0)
#: A piece in which next to nothing happens counts this part of the one in which most happens.
LEAST_DENSITY = 0.02
#: For the numbers being whole, and switches moving.
MARGIN = 1.1
#: Elements that one step of the search adds to a stage, as a part of those that it has.
STEP = 0.05


@dataclass(frozen=True)
class Dense:
    """A smooth piece: the place of its control stage (from 0), its length, the density D."""

    stage: int
    length: float
    density: float


def densities(solution, order):
    """The pieces of a solution as ``Dense``."""
    lengths = [p.length for p in solution.pieces]
    found = [float(np.mean((scales(solution, p) / np.diff(p.nodes)) ** (order + 1)) ** (1 / (order + 1))) for p in solution.pieces]
    least = LEAST_DENSITY * max(found) if max(found) > 0 else 1 / sum(lengths)
    places = {stage: k for k, stage in enumerate(solution.grid.stages)}
    return [Dense(places[p.stage], length, max(D, least)) for p, length, D in zip(solution.pieces, lengths, found)]


def scales(solution, piece):
    """theta_n of the elements of a piece."""
    K, h, largest = len(solution.grid.tau), np.diff(piece.nodes), np.zeros(len(piece.elements))
    for name, size in solution.states.items():
        top = np.array([_top(*solution.polynomial(name, e)) for e in piece.elements]) * factorial(K) / h**K
        if len(top) == 1:
            # no neighbour: the derivative that there is
            scale = (h**K * np.abs(top) / size) ** (1 / K)
        else:
            between = np.abs(np.diff(top)) / ((h[1:] + h[:-1]) / 2)
            scale = (h ** (K + 1) * np.maximum([*between, 0], [0, *between]) / size) ** (1 / (K + 1))
        largest = np.fmax(largest, scale)
    return largest


def _top(tau, values):
    """The coefficient of tau**K."""
    return np.linalg.solve(np.vander(tau), values)[0]


def effective(solution, pieces, order):
    """N of a solution, with the densities of one that it can be compared with."""
    M = sum(np.sum((dense.density * np.diff(p.nodes)) ** (order + 1)) for p, dense in zip(solution.pieces, pieces))
    return float(M ** (-1 / order))


def expected(numbers, pieces, order):
    """The parts of M of the control stages, for numbers of elements that nothing is solved for yet."""
    lengths, M = np.zeros(len(numbers)), np.zeros(len(numbers))
    for dense in pieces:
        lengths[dense.stage] += dense.length
    for dense in pieces:
        h = min(lengths[dense.stage] / numbers[dense.stage], dense.length)
        M[dense.stage] += dense.length / h * (dense.density * h) ** (order + 1)
    return M


def next_numbers(numbers, pieces, order, factor, most):
    """Numbers of elements that are effectively ``factor`` times as many, none of them smaller than now.

    Parameters
    ----------
    numbers : list of int
        of the present round
    pieces : list of Dense
    order : int
    factor : float
    most : list of int
    """
    factor = float(np.clip(factor * MARGIN, *GROWTH))
    found, M = np.array(numbers), expected(numbers, pieces, order)
    wanted, full = sum(M) * factor**-order, np.array(most)
    while sum(M) > wanted and sum(found) < GROWTH[1] * sum(numbers) and np.any(found < full):
        # where one more element is worth most
        stage = int(np.argmax(np.where(found < full, M / found, -1.0)))
        found[stage] = min(full[stage], found[stage] + max(1, int(STEP * found[stage])))
        M = expected(found, pieces, order)
    return [int(n) for n in found]


def most_numbers(wrt, ncp):
    """The largest numbers of elements that pyomo.dae's labels can tell apart."""
    points = list(wrt)
    return [int((b - a) / (2 * LABEL_RESOLUTION * (ncp + 1) ** 2)) for a, b in zip(points, points[1:])]
