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


def of_growth(lpec, unchanged, enough) -> Verdict:
    """The verdict of the LPEC in which a part may grow, where a relative descent below ``enough`` does not count.

    Parameters
    ----------
    lpec : callable
        of the cost of a unit of the part's extent; None where there is no LPEC
    unchanged : callable
        the same LPEC for a part that changes nothing, whose descent is the error of the method, and the place of its extent
    """
    found = lpec(0.0)
    if found is not None and found.descent > enough:
        found = lpec(_descent_of_unit(*unchanged(), enough))
    if found is None or not found.solved:
        return Verdict.UNKNOWN
    return Verdict.DESCENT if found.descent > enough else Verdict.NO_DESCENT


def _descent_of_unit(found, extent, enough):
    if found is None or not found.solved or found.descent <= enough:
        return 0.0
    return -found.value / found.d[extent] if found.d[extent] > 0 else 0.0


def of_all(verdicts) -> Verdict:
    """The verdict of copies whose values are not determined: those that start from the values of each part beside them."""
    for worst in (Verdict.IMPOSSIBLE, Verdict.DESCENT, Verdict.UNKNOWN):
        if worst in verdicts:
            return worst
    return Verdict.NO_DESCENT
