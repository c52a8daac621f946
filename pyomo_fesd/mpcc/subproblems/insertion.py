"""Whether a part inserted with extent zero may grow with descent (theory, section 4, orders).

The copy of part k begins with the last values of the part before it, and the part after it with those of the copy:

    part j-1  ->  copy of k, of extent h  ->  part j,        j = k (before it) or j = k + 1 (after it)

With h = 0 this is the present point, whatever the zero sides of the copy.  Its values as h -> 0 show whether these sides are
possible beside the point; if they are, the LPEC with the copy shows whether h may grow with descent.

Takes: a point, and zero sides of the copy and of the part after it.
Leaves: a ``Verdict``.
Does not apply: where the values of the copy have no limit; beside parts of nearly no extent; with fillings.

Values that the equations do not determine, as controls that vary within parts, are those of the part before or after the copy, and
both must give the same verdict: stationarity is a local notion for them too.
"""

import numpy as np

from pyomo_fesd.mpcc.subproblems.active_set import ActiveSets
from pyomo_fesd.mpcc.subproblems.inserted_copy import Copy, Insertion
from pyomo_fesd.mpcc.subproblems.inserted_part import InsertedPart
from pyomo_fesd.mpcc.subproblems.joined_lpec import JoinedLpec, linearised_at_both
from pyomo_fesd.mpcc.subproblems.verdict import Verdict, of_all, of_growth


class Insertions:
    """Judges the insertions into one compiled MPCC.

    Parameters
    ----------
    c : MpccFunctions
    sides : Sides
    parts : Parts
    lpec : Lpec
    tolerances : Tolerances
    """

    def __init__(self, c, sides, parts, lpec, tolerances):
        self._c, self._sides, self._parts, self._lpec, self._tolerances = c, sides, parts, lpec, tolerances

    def verdict(self, w, sets, equal, insertion, present) -> Verdict:
        """Judge an insertion into the point ``w`` with active sets ``sets`` and the decisions ``equal`` in force.

        Parameters
        ----------
        present : Insertion or None
            at the same place, with the sides that are there already: a descent that it has too is one of uneven extents.  None:
            whether the copy may grow is not looked at
        """
        part, found = self._parts.all[insertion.k], []
        if not self._parts.may_be_copied(insertion.k):
            return Verdict.NONE
        if not self._applies(w, insertion, grows=present is not None):
            return Verdict.UNKNOWN
        with self._c.vanishing(np.array([part.extent])):
            for guess in insertion.guesses:
                copy = self._copy(insertion)
                found.append(self._of_copy(w, sets, equal, insertion, copy, guess, present))
                if copy.determined and found[-1] is not Verdict.UNKNOWN:
                    return found[-1]
        return of_all(found)

    def _of_copy(self, w, sets, equal, insertion, copy, guess, present):
        """The verdict by a copy that starts from the values of one part."""
        verdict = self._by_values(w, insertion, copy, guess)
        if verdict is not None or present is None:
            return verdict or Verdict.UNKNOWN
        return of_growth(
            lambda credit: self._by_lpec(w, sets, equal, insertion, copy, credit),
            lambda: self._unchanged(w, sets, equal, present),
            self._tolerances.descent,
        )

    def at_limit(self, w, zero, extents, size):
        """``w`` with the values that parts of extent 0 have as they grow, which their equations may not determine at 0.

        None where they are not determined then either, or have no limit.

        Parameters
        ----------
        zero : int array (q)
            zero sides
        extents : int array
            variables that are 0 at ``w``; None, too, if one of them is that of no part
        size : float
            extents are small relative to this
        """
        for extent in extents:
            k = self._parts.by_extent.get(extent)
            if k is None:
                return None
            copy = Copy(self._c, self._sides, self._parts, Insertion(k, True, zero, zero, (k,)))
            if not (copy.follow(w, size) or copy.solve(w, self._parts.beside(k), size)):
                return None
            w = copy.limit
        return w

    def _applies(self, w, insertion, grows):
        k, part = insertion.k, self._parts.all[insertion.k]
        # the copy of a part whose first values are given begins with them
        begins = part.whole or (part.alike and insertion.ahead and not grows)
        goes_on = not grows or self._following(insertion) is not None
        return begins and goes_on and not (self._parts.ends_with_pairs(k) or self._parts.is_beside_a_short_one(w, k))

    @staticmethod
    def _by_values(w, insertion, copy, guess):
        """The verdict that the values of the copy give; None if its sides are possible."""
        if copy.solve(w, (guess,)):
            if copy.impossible(w):
                return Verdict.IMPOSSIBLE
            return Verdict.UNKNOWN if copy.misses() else None
        return Verdict.IMPOSSIBLE if copy.contradicts_itself(w, insertion.guesses) else Verdict.UNKNOWN

    def _unchanged(self, w, sets, equal, present):
        """The LPEC with a copy that changes nothing (None without one), and the place of its extent."""
        copy = self._copy(present)
        found = self._by_lpec(w, sets, equal, present, copy, 0.0) if copy.solve(w, present.guesses) else None
        return found, len(w) + int(np.flatnonzero(copy.own == copy.part.extent)[0])

    def _copy(self, insertion):
        return Copy(self._parts.of_copies, self._sides, self._parts, insertion)

    def _following(self, insertion):
        """The part after the copy."""
        return insertion.k if insertion.ahead else self._parts.next(insertion.k)

    def _beside(self, w, present, insertion, copy):
        """The point in which the part after the copy begins with its last values; None if its beginning is not determined."""
        following = self._following(insertion)
        first, gate = self._parts.all[following].first, self._parts.all[following].gate
        w = w.copy()
        w[first] = copy.limit[copy.part.last if insertion.ahead else first]
        changed = (insertion.zero_beside != present) & self._parts.in_gate & (self._parts.of_pair == following)
        if not changed.any():
            return w
        rows = np.flatnonzero(self._parts.of_row == following)
        equations = InsertedPart(self._c, self._sides, self._parts, gate, self._in_gate(rows, following), insertion.zero_beside)
        return equations.solve(w)

    def _in_gate(self, rows, k):
        """Those of the rows of part ``k`` that only say how it begins."""
        inner = self._parts.of_variable == k
        inner[self._parts.all[k].gate] = inner[self._parts.all[k].extent] = False
        return rows[self._parts.pattern[rows] @ inner.astype(float) == 0]

    def _by_lpec(self, w, sets, equal, insertion, copy, credit):
        """The LPEC with the copy, growing at ``credit`` more for each unit; None where it is not known."""
        following = self._following(insertion)
        beside = self._beside(w, sets.zero, insertion, copy)
        if beside is None:
            return None
        sets, radius = ActiveSets(insertion.zero_beside, sets.gamma & (insertion.zero_beside == sets.zero)), self._tolerances.radius
        both = linearised_at_both(self._lpec, w, beside, sets, radius, equal)
        if both is None:
            return None
        sets, equal, base, there = both
        joined = JoinedLpec(self._c, self._sides, self._parts, insertion, following, sets, equal)
        if not joined.is_known(w, copy.limit):
            return None
        base, limits = joined.with_following(base, there), copy.limits(radius, joined.fixed_by_following)
        return joined.best(self._lpec, sets, base, (w, beside, copy.limit), credit, limits, copy.fixed)
