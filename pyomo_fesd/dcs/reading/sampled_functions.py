"""Compare switching functions by their values at a few random points.

Two functions are the same if they are proportional, however they are written.  The same values show affine dependence
(``x`` and ``x - 1``), by which sign patterns that no point can have are distinguished from gaps.
"""

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import linprog

from pyomo_fesd.core import FesdError, value_or_nan
from pyomo_fesd.dcs.sampling import start_of, values_kept

#: Relative agreement of two functions' values at random points to count as proportional.
PROPORTIONAL = 1e-11
#: Signs that occur together with less than this between the point and the nearest boundary occur only where boundaries meet.
SMALLEST_MARGIN = 1e-9
#: A function that varies by less than the first part of its size is constant; below the second a start value may be the reason.
CONSTANT, LEAST_START = 1e-10, 1e-9


def sample(disjunction, expressions) -> np.ndarray:
    """Return the values of the expressions at the same random points, shape (expressions, points)."""
    with values_kept(expressions) as variables:
        present = [start_of(v) for v in variables]
        values = _values_around(expressions, variables, present)
        if values is None or (np.ptp(values, axis=1) <= CONSTANT * np.abs(values).max(axis=1)).any():
            # a start value that vanishes beside a threshold, as 1e-20 beside 1, counts as not given
            others = _values_around(expressions, variables, [at if abs(at) > LEAST_START else 1.0 for at in present])
            values = values if others is None else others
    if values is None:
        raise FesdError(
            disjunction,
            f"the region condition '{expressions[0]} >= 0' cannot be evaluated near the initial values of its variables",
            "initialise the variables inside the domain of the expression",
        )
    return values


def _values_around(expressions, variables, start):
    """Values at random points around ``start``; None where the expressions are undefined."""
    count = len(expressions) + 3
    rows, random = [], np.random.default_rng(1)
    for _ in range(20 * count + 1):
        for v, old in zip(variables, start):
            v.set_value(old * random.uniform(0.5, 1.5), skip_validation=True)
        row = [value_or_nan(e) for e in expressions]
        if np.isfinite(row).all():
            rows.append(row)
        if len(rows) == count:
            return np.array(rows).T
    return None


class DistinctFunctions:
    """Functions, none of them proportional to another.

    Attributes
    ----------
    values : list of arrays
        values of each function at the sampled points
    """

    def __init__(self):
        self.values = []

    def find_or_add(self, F) -> tuple[int, int]:
        """Return the index of the function proportional to one with the values ``F``, and the sign of the factor."""
        variation = F - F.mean()
        for k, known in enumerate(self.values):
            other = known - known.mean()
            factor = _factor(variation, other)
            if factor and np.abs(F - factor * known).max() <= PROPORTIONAL * np.abs(variation).max() + 1e-14 * np.abs(F).max():
                return k, int(np.sign(factor))
        self.values.append(F)
        return len(self.values) - 1, 1

    def dependence(self) -> 'AffineDependence':
        """Return the affine relations between the functions."""
        if len(self.values) < 2:
            return AffineDependence(np.zeros((0, 2)))
        F = np.asarray(self.values).T
        scale = np.abs(F - F.mean(axis=0)).max(axis=0)
        F = F / np.where(scale > 0, scale, 1)
        mean = F.mean(axis=0)
        A = null_space(F - mean, rcond=1e-10 + 1e-15 * np.abs(F).max()).T
        return AffineDependence(np.hstack([A, (A @ mean)[:, None]]))


def _factor(variation, other):
    """The factor by which ``variation`` is nearest to ``other``; squares of small numbers are 0 to the machine."""
    size, other_size = np.abs(variation).max(), np.abs(other).max()
    if not size or not other_size:
        return 0.0
    variation, other = variation / size, other / other_size
    return (variation @ other) / (other @ other) * (size / other_size)


class AffineDependence:
    """Affine relations between functions that are scaled by how much they vary.

    Parameters
    ----------
    relations : array, rows (a, b)
        ``a'c = b`` at every point
    """

    def __init__(self, relations):
        self._relations = relations

    @property
    def key(self) -> bytes:
        """Equal for equal relations, however they are combined."""
        return (self._relations.T @ self._relations).round(6).tobytes()

    def margin(self, signs) -> float:
        """Return the largest m <= 1 such that some point has sign_k c_k >= m for all signs but 0; -inf if there is none.

        Above 0 the signs occur together, at 0 only where the boundaries meet.
        """
        relations, signs = self._relations, np.array(signs)
        if not len(relations):
            return 1.0
        n, given = len(signs), np.flatnonzero(signs)
        result = linprog(
            np.append(np.zeros(n), -1.0),
            A_ub=np.hstack([-np.diag(signs)[given], np.ones((len(given), 1))]),
            b_ub=np.zeros(len(given)),
            A_eq=np.hstack([relations[:, :-1], np.zeros((len(relations), 1))]),
            b_eq=relations[:, -1],
            bounds=[(None, None)] * n + [(None, 1.0)],
        )
        return -result.fun if result.status == 0 else -np.inf
