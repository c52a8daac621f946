"""Weak duality: a bound on a linear program from multipliers that are only roughly right."""

import numpy as np


def lower_bound(cost, A, low, high, lower, upper, y):
    """No d with low <= A d <= high and lower <= d <= upper has a cost' d below the value returned.

    For every y:  cost' d = y' A d + (cost - A' y)' d, and each part is bounded on its own.  With the multipliers of a
    solution the bound is the optimal value; with others it is lower, never wrong.

    Parameters
    ----------
    y : array (rows)
        multipliers, positive at ``low``; wrong signs at one-sided rows are set to 0
    """
    y = np.where(np.isneginf(low), np.minimum(y, 0.0), y)
    y = np.where(np.isposinf(high), np.maximum(y, 0.0), y)
    reduced = cost - A.T @ y
    return _least(y, low, high) + _least(reduced, lower, upper)


def _least(factor, low, high):
    """The least sum of factor * v over low <= v <= high."""
    at = np.where(factor > 0, low, high)
    return float(np.sum(np.where(factor == 0, 0.0, factor * np.where(factor == 0, 0.0, at))))
