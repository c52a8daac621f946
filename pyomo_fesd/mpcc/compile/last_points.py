"""Results of a function at the last points: certificates, tests and the log evaluate the same one several times."""

from collections.abc import Callable

import numpy as np

#: Points that are remembered.
KEPT = 4


class LastPoints:
    """A function of two arrays that remembers its results at the last points; these are shared, so nobody may change them.

    Parameters
    ----------
    function : callable (array, array) -> result
    """

    def __init__(self, function: Callable):
        self._function, self._known = function, {}

    def __call__(self, w, parameters):
        key = np.asarray(w, dtype=float).tobytes(), np.asarray(parameters, dtype=float).tobytes()
        found = self._known.pop(key, None)
        # the last one used is at the end
        self._known[key] = found = self._function(w, parameters) if found is None else found
        while len(self._known) > KEPT:
            self._known.pop(next(iter(self._known)))
        return found
