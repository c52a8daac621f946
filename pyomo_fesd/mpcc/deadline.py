"""The time at which everything has to stop; one object for all solvers of a run, which a later run may set anew."""

import time


class Deadline:
    """A deadline, or none.

    Parameters
    ----------
    at : float or None
        value of ``time.perf_counter()``
    """

    def __init__(self, at=None):
        self.at = at

    def left(self):
        """Seconds left, not below 0; None without a deadline."""
        return None if self.at is None else max(0.0, self.at - time.perf_counter())

    def expired(self):
        """Whether the time is up."""
        return self.at is not None and time.perf_counter() > self.at
