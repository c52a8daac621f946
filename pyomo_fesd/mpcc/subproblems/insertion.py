"""Whether parts inserted with extent zero may grow with descent (theory, section 4, orders).

The first copy begins with the last values of the part before it, each one with those of the copy before, and the part after them
with those of the last copy:

    part j-1  ->  copy of k, of extent h  -> ... ->  part j,        j = k (copies before it) or j = k + 1 (after it)

With h = 0 this is the present point, whatever the zero sides of the copies.  Their values as h -> 0 show whether these sides are
possible beside the point; if they are, the LPEC with the copies shows whether extents may grow with descent.

Takes: a point, and zero sides of the copies and of the part after them.
Leaves: a ``Verdict``.
Does not apply: where the values of a copy have no limit; beside parts of nearly no extent; with fillings.

Values that the equations do not determine, as controls that vary within parts, are those of the part before or after the copy, and
both must give the same verdict: stationarity is a local notion for them too.
"""

from functools import partial

import numpy as np

from pyomo_fesd.mpcc.subproblems.active_set import ActiveSets
from pyomo_fesd.mpcc.subproblems.inserted_copy import Copy, Insertion
from pyomo_fesd.mpcc.subproblems.inserted_part import InsertedPart
from pyomo_fesd.mpcc.subproblems.joined_lpec import JoinedLpec, linearised_at_both
from pyomo_fesd.mpcc.subproblems.verdict import Verdict, charge, of_all, of_growth

#: The number of the part after the last one, which has no rows, no pairs and no variables.
AFTER_LAST = -3


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

    def verdict(self, w, sets, equal, insertions, present) -> Verdict:
        """Judge insertions in a row into the point ``w`` with active sets ``sets`` and the decisions ``equal`` in force.

        Parameters
        ----------
        insertions : tuple of Insertion
            one after the other, between the same two parts
        present : tuple of Insertion, or None
            for each of them, alone at the same place, with the sides that are there already: a descent that it has too is one of
            uneven extents.  None: whether the copies may grow is not looked at
        """
        if not all(self._parts.may_be_copied(insertion.k) for insertion in insertions):
            return Verdict.NONE
        if not all(self._applies(w, insertion, grows=present is not None) for insertion in insertions):
            return Verdict.UNKNOWN
        with self._c.vanishing(np.array([self._parts.all[k].extent for k in {insertion.k for insertion in insertions}])):
            grown = None if present is None else partial(self._growth, w, sets, equal, insertions, present)
            return self._in_row(insertions, [], w, grown)

    def _in_row(self, insertions, copies, w, grown):
        """The verdict of a row of which the first ``copies`` are known, from the values ``w`` with which the next one begins."""
        if len(copies) == len(insertions):
            return Verdict.UNKNOWN if grown is None else grown(copies)
        insertion, found = insertions[len(copies)], []
        for guess in insertion.guesses:
            copy = self._copy(insertion, is_first=not copies)
            verdict = self._by_values(w, insertion, copy, guess)
            found.append(verdict or _of_rest(self._in_row(insertions, [*copies, copy], copy.after(w), grown)))
            if copy.determined and found[-1] is not Verdict.UNKNOWN:
                return found[-1]
        return of_all(found)

    def _growth(self, w, sets, equal, insertions, present, copies):
        """The verdict of copies whose sides are possible."""
        return of_growth(
            lambda credits: self._by_lpec(w, sets, equal, insertions, copies, credits),
            lambda: [self._charge(w, sets, equal, unchanged) for unchanged in present],
            self._tolerances.descent,
            len(copies),
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
        begins = self._parts.is_whole(k) or (part.alike and insertion.ahead and not grows)
        return begins and not (self._parts.ends_with_pairs(k) or self._parts.touches_a_short_one(w, k, insertion.ahead))

    @staticmethod
    def _by_values(w, insertion, copy, guess):
        """The verdict that the values of the copy give; None if its sides are possible."""
        if copy.solve(w, (guess,)):
            if copy.impossible(w):
                return Verdict.IMPOSSIBLE
            return Verdict.UNKNOWN if copy.misses() else None
        return Verdict.IMPOSSIBLE if copy.contradicts_itself(w, insertion.guesses) else Verdict.UNKNOWN

    def _charge(self, w, sets, equal, unchanged):
        """The descent per unit of a copy that changes nothing."""
        copy = self._copy(unchanged)
        found = self._by_lpec(w, sets, equal, (unchanged,), [copy], [0.0]) if copy.solve(w, unchanged.guesses) else None
        return charge(found, len(w) + int(np.flatnonzero(copy.own == copy.part.extent)[0]), self._tolerances.descent)

    def _copy(self, insertion, is_first=True):
        return Copy(self._parts.of_copies, self._sides, self._parts, insertion, is_first)

    def _following(self, insertion):
        """The part after the copy; AFTER_LAST without one."""
        following = insertion.k if insertion.ahead else self._parts.next(insertion.k)
        return AFTER_LAST if following is None else following

    def _beside(self, w, present, insertion, copy):
        """The point in which the part after the copy begins with its last values; None if its beginning is not determined."""
        following = self._following(insertion)
        if following == AFTER_LAST:
            return w
        (first, last), gate = self._parts.entry(following), self._parts.all[following].gate
        w = w.copy()
        w[first] = copy.limit[last if insertion.ahead else first]
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

    def _by_lpec(self, w, sets, equal, insertions, copies, credits):
        """The LPEC with the copies, growing at ``credits`` more for each unit; None where it is not known."""
        *_, insertion = insertions
        following, beside = self._following(insertion), self._beside(w, sets.zero, insertion, copies[-1])
        if beside is None:
            return None
        sets, radius = ActiveSets(insertion.zero_beside, sets.gamma & (insertion.zero_beside == sets.zero)), self._tolerances.radius
        both = linearised_at_both(self._lpec, w, beside, sets, radius, equal)
        if both is None:
            return None
        sets, equal, base, there = both
        joined = JoinedLpec(self._c, self._sides, self._parts, insertions, following, sets, equal)
        limits = [copy.limit for copy in copies]
        if not joined.is_known(w, *limits):
            return None
        base, points = joined.with_following(base, there), (w, beside, *limits)
        bounds, fixed = zip(*((copy.limits(radius), copy.fixed) for copy in copies))
        return joined.searched(self._lpec, sets, base, points, credits, bounds, fixed, self._tolerances.descent)


def _of_rest(verdict):
    """The verdict of a row by that of its rest: what is not possible after some values of a copy has no descent there."""
    return Verdict.NO_DESCENT if verdict is Verdict.IMPOSSIBLE else verdict
