"""Orders of coinciding changes: which there are at a point, with the branches and the inserted places that show where they lead.

Each change comes apart from the others alone, or stays behind alone; at a boundary that does not move all together matter too.

An order with more places than one consists of such places in a row (``rows``).

Takes: the coincidences of a compiled MPCC, a point, and its active sets.
Leaves: the orders.
Does not apply: to orders with more than two places at an end of a row (``has_more_at_end`` tells where there may be some).
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from pyomo_fesd.mpcc.algorithm.arrivals import Entered, branches
from pyomo_fesd.mpcc.algorithm.insertions import AFTER, BEFORE, OrdersByInsertion
from pyomo_fesd.mpcc.algorithm.moves import differs, is_alike, with_moves
from pyomo_fesd.mpcc.subproblems import ActiveSets, Verdict

#: A place nearer to its least extent than this may be none: NLP solvers leave it a little above its bound.
NEAR_BOUND = 1e-4
#: Places that come in at an end at a time.
AT_END = 2
#: Of so many changes each subset is a place of its own; rows with other places are not known.
FEW = 3


@dataclass(frozen=True)
class Inserted:
    """What a place inserted at a coincidence holds.

    Attributes
    ----------
    side : int
        BEFORE a boundary that stays where it is, AFTER it or where there is none
    happened, present : frozenset of int
        the numbers of the changes that have happened there, and of all
    is_short : bool
        whether a place at its lower bound was left out beside the coincidence, where nothing is inserted
    """

    coincidence: object
    side: int
    happened: frozenset
    present: frozenset
    is_short: bool

    @classmethod
    def of(cls, coincidence, side, changes, present, is_short):
        """The place in which ``changes`` have happened."""
        return cls(coincidence, side, *(frozenset(map(coincidence.changes.index, some)) for some in (changes, present)), is_short)

    def precedes(self, other):
        """Whether the other can follow it: one more place of the same coincidence, with no change undone."""
        if self == other or self.coincidence is not other.coincidence or self.side > other.side:
            return False
        return self.happened <= other.happened

    def on_side(self, side):
        """The side and the changes that have happened, for a copy on another ``side`` if there is no boundary that stays."""
        return self.side if self.coincidence.fixed else side, self.changes(self.happened)

    def changes(self, numbers) -> list:
        """The changes with these numbers."""
        return [self.coincidence.changes[k] for k in sorted(numbers)]


@dataclass(frozen=True)
class AtEnd:
    """What a place at an end of a row holds: the change of one system."""

    row: int
    system: int


@dataclass(frozen=True)
class Order:
    """An order of changes: equivalent ways to it, and functions that return the ``Verdict`` of an inserted place.

    ``place`` is what the inserted place holds; None for one of several changes at an end of a row.
    """

    ways: list
    judges: list
    place: Inserted | AtEnd | None = None

    @property
    def key(self):
        """Equal for orders with the same branches and the same place; None without a branch."""
        ways = tuple((way.extents.tobytes(), way.zero.tobytes()) for way in self.ways)
        return (self.place, ways) if ways else None


class Orders:
    """The orders of one run; parameters as ``Coincidences``."""

    def __init__(self, subsolves):
        self._subsolves, self._c, self._tolerances = subsolves, subsolves.compiled, subsolves.tolerances

    def at(self, point, sets) -> Iterator[Order]:
        """Yield the orders of the changes that fall together at a point, those with the same key once."""
        seen = set()
        for order in self._all(point, sets):
            key = order.key
            if key is None or key not in seen:
                seen.add(key)
                yield order

    def _all(self, point, sets):
        w, inserted = point.w, OrdersByInsertion(self._subsolves, point, sets)
        for coincidence, at in self._situations(w, sets):
            present = [change for change in coincidence.changes if differs(change, at)]
            for some in _subsets(present, coincidence.fixed):
                rest = [change for change in present if change not in some]
                moved = some if coincidence.fixed else rest
                rows = [(AFTER, rest)], [(BEFORE, moved)]
                judges = [partial(inserted.row, coincidence, row, present) for row in rows if at is sets]
                later, earlier = with_moves(at.zero, [c.later for c in some]), with_moves(at.zero, [c.earlier for c in moved])
                later = _way(w, coincidence.later, later, coincidence.by_values_later, coincidence.beyond_later, at)
                earlier = _way(w, coincidence.earlier, earlier, coincidence.by_values_earlier, coincidence.beyond_earlier, at)
                after, before = (Inserted.of(coincidence, *row[0], present, at is not sets) for row in rows)
                if coincidence.fixed:
                    yield Order(later, judges[:1], after)
                    yield Order(earlier, judges[1:], before)
                else:
                    yield Order(later + earlier, judges, after)
        for entered, changed, alone in branches(self._c, w, sets, self._tolerances.biactive, partial(self._subsolves.settled, w)):
            judges = [partial(inserted.entered, entered, self._at_end_of(entered)), partial(inserted.at_end, changed)]
            yield Order([] if entered is None else [entered], judges, None if alone is None else AtEnd(*alone))

    def _at_end_of(self, way):
        """The coincidence at an end between two rows, at which a change has come in; None where there is none."""
        if way is None or not way.between:
            return None
        return next((c for c in self._c.coincidences if c.fixed and (c.before, c.after) == tuple(way.extents)), None)

    def judged(self, point, sets, row) -> Verdict:
        """The verdict of places in a row."""
        first = row[0]
        if len(first.present) > FEW or any(place.is_short for place in row) or len({place.present for place in row}) > 1:
            return Verdict.UNKNOWN
        inserted, present = OrdersByInsertion(self._subsolves, point, sets), first.changes(first.present)
        for side in (AFTER,) if first.coincidence.fixed else (AFTER, BEFORE):
            verdict = inserted.row(first.coincidence, [place.on_side(side) for place in row], present)
            if verdict not in (Verdict.UNKNOWN, Verdict.NONE):
                return verdict
        return Verdict.UNKNOWN

    def _situations(self, w, sets) -> Iterator[tuple]:
        """Each coincidence with the active sets; also those as if the place beside it, at its lower bound, were none."""
        by_later, by_earlier = ({getattr(c, side): c for c in self._c.coincidences} for side in ('later', 'earlier'))
        for coincidence in self._c.coincidences:
            yield coincidence, sets
            beside = ((coincidence.later, by_earlier, 'earlier'), (coincidence.earlier, by_later, 'later'))
            for variable, others, direction in beside:
                if variable in others and variable is not None and w[variable] <= self._c.lbx[variable] + NEAR_BOUND:
                    zero = with_moves(sets.zero, [getattr(change, direction) for change in others[variable].changes])
                    yield coincidence, ActiveSets(zero, np.zeros(len(zero), dtype=bool))


def has_more_at_end(possible) -> bool:
    """Whether there may be an order with more places at an end of a row than come in at a time."""
    at_ends = {place for place in possible if isinstance(place, AtEnd)}
    return max(Counter(place.row for place in at_ends).values(), default=0) > AT_END


def rows(possible) -> Iterator[tuple[Inserted, ...]]:
    """Yield the rows of two or more ``possible`` places that follow one another.

    The changes that come apart in a row stay together in each of its places alone, which may leave no direction at all.
    """
    yield from _longer((), [place for place in possible if isinstance(place, Inserted)])


def _longer(row, places):
    for place in places:
        if not row or row[-1].precedes(place):
            if row:
                yield (*row, place)
            yield from _longer((*row, place), places)


def _subsets(changes, fixed):
    """The changes that come apart from the rest: each one alone, all but one, and all if the place itself matters."""
    single = [[change] for change in changes]
    if len(changes) > 2:
        single += [[change for change in changes if change is not left_out] for left_out in changes]
    if fixed:
        return single + ([changes] if len(changes) > 1 else [])
    return single if len(changes) > 1 else []


def _way(w, variable, zero, by_values, beyond, sets):
    """The branch in which a place has no extent, or none where there is no such place."""
    if variable is None:
        return []
    # of the pairs that follow from values both sides are looked at where both are zero: a place that grows may have either
    clear = ~(sets.gamma | sets.open)[by_values.sources]
    zero[by_values.targets[clear]] = sets.zero[by_values.sources[clear]]
    return [Entered(np.array([variable]), zero, w, by_values.targets, spares=is_alike(beyond, sets))]
