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


def of_growth(lpec, charges, enough, number=1) -> Verdict:
    """The verdict of the LPEC in which some parts may grow, where a relative descent below ``enough`` does not count.

    Parameters
    ----------
    lpec : callable
        of the costs of a unit of each part's extent; None where there is no LPEC
    charges : callable
        the descents per unit of parts that change nothing there, which are errors of the method
    number : int
        of parts
    """
    found = lpec([0.0] * number)
    if found is not None and found.descent > enough:
        found = lpec(charges())
    if found is None or not found.solved:
        return Verdict.UNKNOWN
    return Verdict.DESCENT if found.descent > enough else Verdict.NO_DESCENT


def charge(found, extent, enough) -> float:
    """The descent per unit of the variable ``extent`` in the LPEC of a part that changes nothing; 0 without one."""
    if found is None or not found.solved or found.descent <= enough:
        return 0.0
    return -found.value / found.d[extent] if found.d[extent] > 0 else 0.0


def of_all(verdicts) -> Verdict:
    """The verdict of copies whose values are not determined: those that start from the values of each part beside them."""
    for worst in (Verdict.IMPOSSIBLE, Verdict.DESCENT, Verdict.UNKNOWN):
        if worst in verdicts:
            return worst
    return Verdict.NO_DESCENT


def of_orders(verdicts) -> Verdict:
    """The verdict of several orders together: where one of them may descend, or is not decided, all may."""
    for worst in (Verdict.NONE, Verdict.DESCENT, Verdict.UNKNOWN, Verdict.NO_DESCENT):
        if worst in verdicts:
            return worst
    return Verdict.IMPOSSIBLE
