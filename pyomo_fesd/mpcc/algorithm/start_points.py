"""Random start points, each a function of the seed and its number only."""

import numpy as np

#: The reach of a start is drawn log-uniformly between these, as powers of ten.
REACH = (-1.0, 2.0)
#: A range between finite bounds counts as huge from this many times max(1, |x|).
HUGE = 1e3


def start_point(c, x0: np.ndarray, seed: int, number: int) -> np.ndarray:
    """Draw start ``number`` of an MPCC; number 0 is ``x0``.

    With x the model's values, in the model's units, and a reach r between 0.1 and 100, log-uniform, one for the whole start:

    * A variable between finite bounds is uniform between them.
    * Any other one, also where the bounds are huge (beyond 1000 max(1, |x|)), is uniform within x +- r max(1, |x|) and its bounds.
    * Odd starts draw all variables; even ones each with probability n^-u, u uniform in [0, 1]: from nearly all of the n to one.
      Where many variables depend on one another, a point drawn in all of them is far from any solution.
    * Variables with guide bounds stay as they are.

    Parameters
    ----------
    c : MpccFunctions
    x0 : array (n)
        the model's values, in the solver's units as the result
    """
    if number == 0:
        return x0
    random = np.random.default_rng([seed, number])
    s = c.scale.x
    x, lower, upper, n = x0 / s, c.lbx / s, c.ubx / s, len(x0)
    size = np.maximum(1.0, np.abs(x))
    reach = 10.0 ** random.uniform(*REACH) * size
    share = 1.0 if number % 2 else n ** -random.uniform()
    drawn = (random.uniform(size=n) <= share) & ~c.guided
    huge = ~(upper - lower <= HUGE * size)
    low, high = np.where(huge, np.maximum(lower, x - reach), lower), np.where(huge, np.minimum(upper, x + reach), upper)
    return np.where(drawn, low + random.uniform(size=n) * (high - low), x) * s
