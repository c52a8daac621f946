"""Linear functionals of interpolating polynomials as weights of the interpolated values."""

from collections.abc import Sequence

import numpy as np


def interpolation_weights(nodes: Sequence[float], moments: Sequence) -> np.ndarray:
    """Return w with L(f) = sum_j w_j f(nodes_j) for every polynomial f through K nodes.

    Parameters
    ----------
    nodes : sequence of float, length K
    moments : array (K) or (K, number of functionals)
        L(t**k) for k = 0, ..., K - 1; e.g. ones for the value at t = 1, (0, ..., 0, 1) for the leading coefficient, (0, 1, 0, ...)
        for the derivative at t = 0, 1/(k + 1) for the integral over [0, 1]
    """
    return np.linalg.solve(np.vander(nodes, increasing=True).T, moments)
