"""The gap test: is the incumbent the point that the homotopy leads to, or a worse branch? (theory, section 4)

Along the homotopy the relaxed objective rises towards the MPCC's value: f(0) - f(eps) is O(eps) where complementarity is strict
and at most O(sqrt(eps)) elsewhere.  Two values in a row therefore bound how much is still to come.
"""

import numpy as np

#: What is still to come counts up to this much of the incumbent's objective: two values in a row can mislead.
TRUSTED = 5e-4


class GapTest:
    """Relaxed objectives of one homotopy, first to last.

    Parameters
    ----------
    absolute, relative : float
        gaps below these count as none
    """

    def __init__(self, absolute, relative):
        self._absolute, self._relative, self._path = absolute, relative, []

    def restart(self):
        """A new homotopy begins: older values say nothing about it."""
        self._path = []

    def add(self, eps, f):
        """The relaxed objective at ``eps``."""
        self._path.append((eps, f))

    def closed(self, f):
        """Whether an incumbent with objective ``f`` does not lie above what the homotopy still promises."""
        if not self._path:
            return False
        return f - self._path[-1][1] <= max(self._absolute, self._relative * abs(f), min(self._to_come(), TRUSTED * abs(f)))

    def _to_come(self):
        """The most that the relaxed objective may still rise: sqrt(eps) extrapolated to 0 from the last two values."""
        if len(self._path) < 2:
            return 0.0
        (eps_before, before), (eps, now) = self._path[-2:]
        growth = np.sqrt(eps_before / eps) - 1
        return max(now - before, 0.0) / growth if growth > 0.0 else 0.0
