"""The time at which all solvers of a run stop; one object that a later run may set anew."""

import time


class OutOfTime(Exception):
    """The time is up before there is anything to return."""


class Deadline:
    """A deadline, or none.

    Parameters
    ----------
    at : float or None
        value of ``time.perf_counter()``
    """

    def __init__(self, at=None):
        self.at = at

    @classmethod
    def after(cls, seconds: float | None) -> 'Deadline':
        """The deadline this many seconds from now; none for None."""
        return cls(None if seconds is None else time.perf_counter() + seconds)

    def part(self, share: float) -> 'Deadline':
        """The deadline after a share of the seconds left; none without one."""
        left = self.left()
        return Deadline.after(None if left is None else share * left)

    def at_most(self, seconds: float) -> 'Deadline':
        """The deadline this many seconds from now, or this one if it is earlier."""
        return self if self.within(seconds) else Deadline.after(seconds)

    def left(self) -> float | None:
        """Seconds left, not below 0; None without a deadline."""
        return None if self.at is None else max(0.0, self.at - time.perf_counter())

    def within(self, seconds: float) -> bool:
        """Whether fewer seconds than these are left."""
        return self.at is not None and self.left() < seconds

    def check(self) -> None:
        """Raise OutOfTime if the time is up."""
        if self.expired():
            raise OutOfTime

    def expired(self) -> bool:
        """Whether the time is up."""
        return self.at is not None and time.perf_counter() > self.at
