"""What the insertion of a part shows.

Takes: the result of an LPEC in which the part may grow, or the verdicts of copies that start from several values.
Leaves: a ``Verdict``.
"""

from enum import Enum


class Verdict(Enum):
    """What an inserted part shows."""

    IMPOSSIBLE = 'its sides are not possible beside the point'
    NO_DESCENT = 'it cannot grow with descent'
    DESCENT = 'it may grow with descent'
    UNKNOWN = 'not decided'
    NONE = 'nothing can be inserted there'


def of_lpec(found, enough) -> Verdict:
    """The verdict of an LPEC (None where there is none), in which a relative descent below ``enough`` does not count."""
    if found is None or not found.solved:
        return Verdict.UNKNOWN
    return Verdict.DESCENT if found.descent > enough else Verdict.NO_DESCENT


def of_all(verdicts) -> Verdict:
    """The verdict of copies whose values are not determined: those that start from the values of each part beside them."""
    for worst in (Verdict.IMPOSSIBLE, Verdict.DESCENT, Verdict.UNKNOWN):
        if worst in verdicts:
            return worst
    return Verdict.NO_DESCENT
