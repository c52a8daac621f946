"""How many elements each control stage gets.

Between two switches elements are equal (eq. 13), so what is placed are numbers n_s.  With the local scale

    theta_n = (h_n**(K+1) |x^(K+1)| / |x|)**(1/(K+1))

of element n, from the differences of the K-th derivatives of the collocation polynomials (as in COLSYS), a stage needs elements
in proportion to its weight W_s = n_s (mean theta_n**(p+1))**(1/(p+1)).  Errors are those of an *effective* number,

    N = (sum_s n_s (W_s/n_s)**(p+1))**(-1/p),     error ~ N**-p,

which is in proportion to the n_s if all of them grow alike.

Source: U. Ascher, J. Christiansen and R. D. Russell, Collocation software for boundary-value ODEs, ACM TOMS 7, 1981.
"""

from math import ceil, factorial

import numpy as np

from pyomo_fesd.elements.grid import LABEL_RESOLUTION

#: Least and largest growth of the number of elements from one round to the next.
GROWTH = (1.25, 4.0)
#: A stage in which next to nothing happens counts this part of the one in which most happens.
LEAST_WEIGHT = 0.02
#: For the numbers being whole, and switches moving.
MARGIN = 1.1


def weights(solution, order):
    """W_s of every control stage, as an array."""
    found = []
    for stage, elements in solution.grid.stages.items():
        scales = [s for p in solution.pieces if p.stage == stage for s in _scales(solution, p)]
        found.append(len(elements) * np.mean(np.power(scales, order + 1)) ** (1 / (order + 1)))
    most = max(found)
    return np.maximum(found, LEAST_WEIGHT * most) if most > 0 else np.ones(len(found))


def _scales(solution, piece):
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


def effective(numbers, stages, order):
    """N of numbers of elements, with the weights of the stages."""
    numbers = np.asarray(numbers, float)
    return float(np.sum(numbers * (stages / numbers) ** (order + 1)) ** (-1 / order))


def next_numbers(numbers, stages, order, factor, most):
    """Numbers of elements that are effectively ``factor`` times as many, none of them smaller than now.

    Parameters
    ----------
    numbers : list of int
        of the present round
    stages : ndarray
        weights of the stages
    most : list of int
    """
    factor = float(np.clip(factor * MARGIN, *GROWTH))
    wanted, total = factor * effective(numbers, stages, order), sum(numbers)
    found = list(numbers)
    while effective(found, stages, order) < wanted and sum(found) < GROWTH[1] * sum(numbers) and found != list(most):
        total = max(total + 1, ceil(1.02 * total))
        found = [max(n, min(m, ceil(total * w / sum(stages)))) for n, m, w in zip(numbers, most, stages)]
    return found


def most_numbers(wrt, ncp):
    """The largest numbers of elements that pyomo.dae's labels can tell apart."""
    points = list(wrt)
    return [int((b - a) / (2 * LABEL_RESOLUTION * (ncp + 1) ** 2)) for a, b in zip(points, points[1:])]
