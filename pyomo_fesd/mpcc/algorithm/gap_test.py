"""The gap test: does the homotopy still promise a better objective than the incumbent's? (theory, section 4)

Along the homotopy the relaxed objective rises towards the MPCC's value: f(0) - f(eps) is O(eps) where complementarity is strict
and at most O(sqrt(eps)) elsewhere.  Two values in a row therefore bound the rise that remains.
"""

import numpy as np

#: The remaining rise counts up to this much of the incumbent's objective, as two values in a row can mislead.
TRUSTED = 5e-4
#: A gap below this part of the objective is nearly closed: 9 of 15 hoppers ended earlier so, and none at another point.
NEARLY = 1e-2


class GapTest:
    """Relaxed objectives of one homotopy, first to last.

    Parameters
    ----------
    absolute, relative : float
        gaps below these count as closed
    """

    def __init__(self, absolute, relative):
        self._absolute, self._relative, self._path = absolute, relative, []

    def restart(self):
        """Forget all values, for a new homotopy."""
        self._path = []

    def add(self, eps, f):
        """Add the relaxed objective at ``eps``."""
        self._path.append((eps, f))

    def same(self, f: float, best: float) -> bool:
        """Whether an objective ``f`` is as good as the incumbent's."""
        return f - best <= max(self._absolute, self._relative * abs(best))

    def closed(self, f: float) -> bool:
        """Whether an incumbent's objective ``f`` is as good as the homotopy still promises."""
        if not self._path:
            return False
        return f - self._path[-1][1] <= max(self._absolute, self._relative * abs(f), min(self._remaining_rise(), TRUSTED * abs(f)))

    def nearly_closed(self, f: float) -> bool:
        """Whether ``f`` is so near to what the homotopy promises that neighbouring branches are worth more than smaller eps."""
        return self.closed(f) or (bool(self._path) and f - self._path[-1][1] <= NEARLY * abs(f))

    def _remaining_rise(self):
        """The most that the relaxed objective may still rise: sqrt(eps) extrapolated to 0 from the last two values."""
        if len(self._path) < 2:
            return 0.0
        (eps_before, before), (eps, now) = self._path[-2:]
        growth = np.sqrt(eps_before / eps) - 1
        return max(now - before, 0.0) / growth if growth > 0.0 else 0.0
