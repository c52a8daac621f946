"""Orders of coinciding changes as insertions: which sides copies of parts have between the changes (theory, section 4, orders).

In each copy some of the changes have happened.  It is a copy of the part after the boundary, in which those that have not
happened yet have the sides of the place before; or of the part before it, in which those that have happened have the sides of the
place after.

Takes: coincidences, and the parts of the model.
Leaves: the ``Verdict`` of each order.
Does not apply: to models without parts.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from pyomo_fesd.mpcc.algorithm.moves import differs
from pyomo_fesd.mpcc.subproblems import G_ZERO, H_ZERO, EndInsertion, Insertion, Verdict, of_orders

#: Whether a copy lies before the part beside an end between two rows: that on the near side of it, and that on the far side.
SIDES = False, True
#: Of more pairs that may have either side not all combinations are judged.
FEW = 4
#: The side of the boundary on which a copy lies.
BEFORE, AFTER = 0, 1


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

    def row(self, coincidence, places, present) -> Verdict:
        """The verdict of places in a row between the changes that are ``present``.

        Parameters
        ----------
        places : sequence of (int, collection)
            the side of the boundary, and the changes that have happened in that place
        """
        beside = {BEFORE: coincidence.before, AFTER: coincidence.after}
        numbers = {side: self._parts.by_extent.get(extent) for side, extent in beside.items()}
        if any(numbers[side] is None for side, _ in places):
            return Verdict.NONE
        unchanged = {BEFORE: (), AFTER: present}
        alone = tuple(self._row(numbers, coincidence, [(side, unchanged[side])], present)[0] for side, _ in places)
        return self._subsolves.insertion(self._point, self._sets, self._row(numbers, coincidence, places, present), alone)

    def entered(self, way, coincidence) -> Verdict:
        """The verdict of a change that has come in on both sides of an end between two rows: both must be possible.

        ``coincidence`` is that of the changes at this end; what happens there may happen before the change that has come in.
        """
        if way is None or not way.between or len(way.extents) != len(SIDES):
            return Verdict.NONE
        places = [(self._parts.by_extent.get(extent), ahead) for extent, ahead in zip(way.extents, SIDES)]
        if any(k is None for k, _ in places):
            return Verdict.NONE
        found = [self._judged(way, [place], grows=False) for place in places]
        if Verdict.NONE in found:
            return Verdict.NONE
        # what has come in on one side only would have to go back as it arrives at the end
        both = Verdict.IMPOSSIBLE if Verdict.IMPOSSIBLE in found else self._judged(way, places, grows=True)
        return of_orders([both, *self._behind_what_happens(way, coincidence)])

    def _judged(self, way, places, grows):
        """The verdict of such a change in places in a row; unless it ``grows`` by their values alone."""
        order, unchanged = (
            tuple(Insertion(k, ahead, zero, self._sets.zero, (k, *self._parts.beside(k))) for k, ahead in places)
            for zero in (way.zero, self._sets.zero)
        )
        return self._subsolves.insertion(self._point, self._sets, order, unchanged if grows else None)

    def _behind_what_happens(self, way, coincidence) -> list:
        """The verdict of such a change in a place before the end at the beginning of which happens what happens at the end.

        As bodies that part exactly at the boundary after an impact: where it comes earlier they may stay together until then.
        """
        present = [] if coincidence is None else [change for change in coincidence.changes if differs(change, self._sets)]
        if not any(np.any(self._sets.zero[change.happening] != G_ZERO) for change in present):
            return []
        k = self._parts.by_extent[way.extents[0]]
        (moved,), (alone,) = (
            self._row({BEFORE: k, AFTER: k + 1}, coincidence, [(BEFORE, happened)], present) for happened in (present, ())
        )
        entered = (way.zero != self._sets.zero) & (self._parts.of_pair == k) & ~self._parts.in_gate
        order = replace(moved, zero=np.where(entered, way.zero, moved.zero))
        return [self._subsolves.insertion(self._point, self._sets, (order,), (alone,))]

    def at_end(self, changed) -> Verdict:
        """The verdict of a change that has come in at an end of all rows."""
        if changed is None:
            return Verdict.NONE
        end, inner = (self._parts.by_extent.get(extent) for extent in (changed.extent, changed.inner))
        if end is None or inner is None or inner not in self._parts.beside(end):
            return Verdict.NONE
        if self._parts.all[end].gate.size:
            return self._behind_last(changed, end, inner) if self._parts.next(end) is None else Verdict.NONE
        if changed.either.size:
            return Verdict.NONE
        order = EndInsertion(end, inner, changed.zero, changed.targets, changed.sources)
        return self._subsolves.insertion_at_end(self._point, self._sets, order)

    def _behind_last(self, changed, end, inner):
        """The verdict of copies behind the last part that begin with what changes at the end, for all sides that may be either."""
        if len(changed.either) > FEW:
            return Verdict.NONE
        is_gate = self._parts.in_gate & (self._parts.of_pair == end)
        unchanged, zero = (np.where(is_gate, G_ZERO, sides) for sides in (self._sets.zero, changed.zero))
        zero[changed.changed] = changed.zero[changed.changed]
        verdicts, alone = [], Insertion(end, False, unchanged, self._sets.zero, (end, inner))
        for sides in product((G_ZERO, H_ZERO), repeat=len(changed.either)):
            zero[changed.either] = sides
            order = Insertion(end, False, zero.copy(), self._sets.zero, (end, inner))
            verdicts.append(self._subsolves.insertion(self._point, self._sets, (order,), (alone,)))
        return of_orders(verdicts)

    def _row(self, numbers, coincidence, places, present) -> tuple:
        """The insertions of places in a row; ``numbers`` are those of the parts on both sides of the boundary."""
        (last_side, happened), found, before = places[-1], [], ()
        following = numbers[last_side] + (last_side == BEFORE)
        beside = self._with_gates(self._sets.zero, following, happened)
        for side, those in places:
            k, sides = numbers[side], {BEFORE: self._before, AFTER: self._after}[side]
            zero = self._with_gates(sides(k, coincidence, those, present), k, before)
            found.append(Insertion(k, side == AFTER, zero, beside, (k - 1 if side == AFTER else k + 1, k)))
            before = those
        return tuple(found)

    def _after(self, k, coincidence, happened, present):
        """Zero sides with those of a copy of the part ``k`` after the boundary."""
        zero = self._sets.zero.copy()
        for change in present:
            if change not in happened:
                self._take(zero, change.later, self._inside(change.later.targets, k))
                zero[self._gate(change, k)] = G_ZERO
        return zero

    def _before(self, k, coincidence, happened, present):
        """Zero sides with those of a copy of the part ``k`` before the boundary."""
        zero = self._sets.zero.copy()
        for change in coincidence.changes:
            moves = change.earlier
            of_part = self._parts.of_pair[moves.targets] == k
            if change in happened:
                self._take(zero, moves, of_part)
            elif change in present:
                zero[self._gate(change, k)] = G_ZERO
            else:
                self._take(zero, moves, of_part & self._parts.in_gate[moves.targets])
        return zero

    def _with_gates(self, zero, k, happened):
        """Zero sides in which part ``k`` does not begin with changes that have ``happened`` before."""
        zero = zero.copy()
        for change in happened:
            zero[self._gate(change, k)] = G_ZERO
        return zero

    def _take(self, zero, moves, chosen):
        zero[moves.targets[chosen]] = self._sets.zero[moves.sources[chosen]]

    def _inside(self, pairs, k):
        return (self._parts.of_pair[pairs] == k) & ~self._parts.in_gate[pairs]

    def _gate(self, change, k):
        """The pairs of a change that say how part ``k`` begins."""
        pairs = np.concatenate([part for moves in (change.later, change.earlier) for part in vars(moves).values()])
        return pairs[(self._parts.of_pair[pairs] == k) & self._parts.in_gate[pairs]]
