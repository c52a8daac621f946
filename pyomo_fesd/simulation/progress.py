"""Progress of a pass through the elements, and why it cannot go on.

Where switches accumulate (Zeno), their intervals shrink geometrically, and no number of elements reaches beyond their limit.
"""

from collections.abc import Iterable, Sequence

from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError
from pyomo_fesd.mpcc import Deadline

#: So many intervals between events of one name, each shorter than this part of the last, indicate accumulation.
SHRINKING, CLEARLY = 4, 0.95


def accumulation(events: Sequence[tuple[float, str]]) -> tuple[list[float], float] | None:
    """Return the last times and the limit of events that accumulate; None if none do.

    Parameters
    ----------
    events : list of (time, name)
    """
    for name in dict.fromkeys(name for _, name in events):
        times = [time for time, other in events if other == name]
        intervals = [b - a for a, b in zip(times, times[1:])][-SHRINKING:]
        ratios = [b / a for a, b in zip(intervals, intervals[1:]) if a > 0]
        if len(ratios) == SHRINKING - 1 and max(ratios) <= CLEARLY:
            return times[-SHRINKING:], times[-1] + intervals[-1] * ratios[-1] / (1 - ratios[-1])
    return None


class TooFewElements(FesdError):
    """There are more switches than elements, and the switches do not accumulate: more elements help."""


class Progress:
    """Time reached in a pass, and events so far.

    Attributes
    ----------
    time : float
        physical time
    deadline : Deadline
    events : dict control stage -> list of (time, name)
    """

    def __init__(self, wrt: ContinuousSet, stages: Iterable[int], deadline: Deadline):
        self._wrt, self._stages, self.deadline = wrt, tuple(stages), deadline
        self.begin()

    def begin(self) -> None:
        """Begin at the first time."""
        self.time, self.events = float(self._wrt.first()), {stage: [] for stage in self._stages}

    def check_time(self) -> None:
        """Raise an error if the time is up."""
        if self.deadline.expired():
            cause = f"simulate: the time limit is reached at time {self.time:.6g}"
            raise FesdError(self._wrt, cause, "give more time (time_limit); the model has the values up to there")

    def error(self, cause: str, fix: str, kind: type = FesdError) -> FesdError:
        """Return the error of a simulation that cannot go on, of this ``kind``; accumulating switches replace other causes."""
        limit = accumulation([event for events in self.events.values() for event in events])
        if limit is not None:
            times = ', '.join(f'{t:.9g}' for t in limit[0])
            cause = f"the switches accumulate (Zeno): the last ones are at times {times}, their limit is about {limit[1]:.6g}"
            kind, fix = FesdError, "no number of elements reaches beyond: end before, or model what happens there (a rest, a slide)"
        return kind(self._wrt, f"simulate: {cause}", fix)
