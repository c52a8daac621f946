"""Switches that accumulate (Zeno): their intervals shrink geometrically, and no number of elements reaches beyond their limit."""

#: So many intervals between events of one name, each clearly shorter than the last, are a sign of it.
SHRINKING, CLEARLY = 4, 0.95


def accumulation(events):
    """The last times and the limit of events that accumulate; None if there are none.

    Parameters
    ----------
    events : list of (time, name)
    """
    for name in dict.fromkeys(name for _, name in events):
        times = [time for time, other in events if other == name]
        gaps = [b - a for a, b in zip(times, times[1:])][-SHRINKING:]
        ratios = [b / a for a, b in zip(gaps, gaps[1:]) if a > 0]
        if len(ratios) == SHRINKING - 1 and max(ratios) <= CLEARLY:
            return times[-SHRINKING:], times[-1] + gaps[-1] * ratios[-1] / (1 - ratios[-1])
    return None
