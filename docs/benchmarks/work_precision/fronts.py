"""Fronts of error and time, and fitted orders."""

import numpy as np
from benchmarks.common.fits import exponent

#: Errors below are round-off.
ROUND_OFF = 1e-15


def front(rows, clock='cpu'):
    """Times and errors of the claimed runs that no other run beats in both, in the order of time."""
    rows = rows[rows['claimed'] & rows['error'].notna()].sort_values([clock, 'error'])
    errors = np.maximum(rows['error'].to_numpy(float), ROUND_OFF)
    best = errors < np.minimum.accumulate(np.append(np.inf, errors))[:-1]
    return rows[clock].to_numpy(float)[best], errors[best]


def time_at(rows, error, clock='cpu'):
    """Time to reach ``error``, between two points of the front on logarithmic scales; infinite beyond its end."""
    times, errors = front(rows, clock)
    if not len(errors) or errors[-1] > error:
        return np.inf
    return float(np.exp(np.interp(-np.log(error), -np.log(errors), np.log(times))))


def slope(N, errors):
    """Fitted order of accuracy."""
    return -exponent(N, errors)
