"""Orders of coinciding changes as insertions: which sides a copy of a part has between the changes (theory, section 4, orders).

Some changes come one place later: the copy lies before the place after them, with the sides of the place before.  Or they come
earlier: it lies after the place before them, with the sides of the place after.  The other changes stay.

Takes: coincidences, and the parts of the model.
Leaves: the ``Verdict`` of each order.
Does not apply: to models without parts.
"""

import numpy as np

from pyomo_fesd.mpcc.subproblems import G_ZERO, EndInsertion, Insertion, Verdict

#: Whether a copy lies before the part beside an end between two rows: that on the near side of it, and that on the far side.
SIDES = False, True


class OrdersByInsertion:
    """Judges orders at one point.

    Parameters
    ----------
    subsolves : Subsolves
    point : Point
    sets : ActiveSets
        at the point
    """

    def __init__(self, subsolves, point, sets):
        self._subsolves, self._parts = subsolves, subsolves.parts
        self._point, self._sets = point, sets

    def later(self, coincidence, some, present) -> Verdict:
        """The verdict if ``some`` of the changes that are ``present`` come later."""
        return self._verdict(coincidence, coincidence.after, some, present, self._later)

    def earlier(self, coincidence, some, present) -> Verdict:
        """The verdict if ``some`` of the changes that are ``present`` come earlier."""
        return self._verdict(coincidence, coincidence.before, some, present, self._earlier)

    def entered(self, way) -> Verdict:
        """The verdict of a change that has come in on both sides of an end between two rows: both must be possible."""
        if way is None or not way.between or len(way.extents) != len(SIDES):
            return Verdict.NONE
        found = [self._beside_boundary(way, extent, ahead) for extent, ahead in zip(way.extents, SIDES)]
        return next((verdict for verdict in (Verdict.IMPOSSIBLE, Verdict.UNKNOWN) if verdict in found), Verdict.NONE)

    def _beside_boundary(self, way, extent, ahead):
        """The verdict of the place on one side of such an end, by its values alone."""
        k = self._parts.by_extent.get(extent)
        if k is None:
            return Verdict.NONE
        order = Insertion(k, ahead, way.zero, self._sets.zero, (k, *self._parts.beside(k)))
        return self._subsolves.insertion(self._point, self._sets, order, None)

    def at_end(self, changed) -> Verdict:
        """The verdict of a change that has come in at an end of all rows."""
        if changed is None:
            return Verdict.NONE
        end, inner = (self._parts.by_extent.get(extent) for extent in (changed.extent, changed.inner))
        if end is None or inner is None or inner not in self._parts.beside(end):
            return Verdict.NONE
        order = EndInsertion(end, inner, changed.zero, changed.targets, changed.sources)
        return self._subsolves.insertion_at_end(self._point, self._sets, order)

    def _verdict(self, coincidence, extent, some, present, insertion):
        k = self._parts.by_extent.get(extent)
        if k is None:
            return Verdict.NONE
        order, unchanged = (insertion(k, coincidence, moved, present) for moved in (some, ()))
        return self._subsolves.insertion(self._point, self._sets, order, unchanged)

    def _later(self, k, coincidence, some, present):
        zero, beside = self._sets.zero.copy(), self._sets.zero.copy()
        for change in some:
            self._take(zero, change.later, self._inside(change.later.targets, k))
            zero[self._gate(change, k)] = G_ZERO
        for change in present:
            if change not in some:
                beside[self._gate(change, k)] = G_ZERO
        return Insertion(k, True, zero, beside, (k - 1, k))

    def _earlier(self, k, coincidence, some, present):
        zero, beside = self._sets.zero.copy(), self._sets.zero.copy()
        for change in coincidence.changes:
            moves = change.earlier
            of_part = self._parts.of_pair[moves.targets] == k
            if change in some:
                self._take(zero, moves, of_part)
                beside[self._gate(change, k + 1)] = G_ZERO
            elif change in present:
                zero[self._gate(change, k)] = G_ZERO
            else:
                self._take(zero, moves, of_part & self._parts.in_gate[moves.targets])
        return Insertion(k, False, zero, beside, (k + 1, k))

    def _take(self, zero, moves, chosen):
        zero[moves.targets[chosen]] = self._sets.zero[moves.sources[chosen]]

    def _inside(self, pairs, k):
        return (self._parts.of_pair[pairs] == k) & ~self._parts.in_gate[pairs]

    def _gate(self, change, k):
        """The pairs of a change that say how part ``k`` begins."""
        pairs = np.concatenate([part for moves in (change.later, change.earlier) for part in vars(moves).values()])
        return pairs[(self._parts.of_pair[pairs] == k) & self._parts.in_gate[pairs]]
