"""Arrivals: the branches in which changes exactly at an end of a row of places have come in (theory, section 4).

Each branch has a place of extent zero at the end, beyond the change; everything else has moved inwards up to the first place beside
an equal one.  Sides that other pairs make superfluous are no change: where no forces act, "forces or slip are zero" says nothing
more.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np

from pyomo_fesd.mpcc.subproblems import G_ZERO, H_ZERO

#: Pairs of one family, or systems, that are combined in all ways; of more only each one, and all.
FEW = 3
OTHER = {G_ZERO: H_ZERO, H_ZERO: G_ZERO}
NONE = np.zeros(0, dtype=int)


@dataclass(frozen=True)
class Entered:
    """A branch in which changes have come in.

    Attributes
    ----------
    extents : int array
        variables that vanish
    zero : int array (q)
    start : array (n)
        values to start from
    either : int array
        pairs of which any side may be zero
    between : bool
        whether one change has come in on both sides of an end between two rows
    spares : bool
        whether nothing else is lost where the variables vanish
    """

    extents: np.ndarray
    zero: np.ndarray
    start: np.ndarray
    either: np.ndarray
    between: bool = False
    spares: bool = True


@dataclass(frozen=True)
class ChangedEnd:
    """The place at an end in which a change has come in, nothing else moved.

    Attributes
    ----------
    extent, inner : int
        those of the place and of the one beside it
    zero : int array (q)
    changed, either : int arrays
        the pairs that change, and those of which any side may be zero then
    targets, sources : int arrays
        pairs of the place beside it, and those of the place that mean the same
    """

    extent: int
    inner: int
    zero: np.ndarray
    changed: np.ndarray
    either: np.ndarray
    targets: np.ndarray
    sources: np.ndarray


@dataclass(frozen=True)
class _Change:
    """Zero sides that pairs get beyond a change."""

    pairs: np.ndarray
    sides: np.ndarray
    either: np.ndarray

    def __add__(self, other):
        return _Change(*(np.concatenate(both) for both in zip(vars(self).values(), vars(other).values())))


def branches(c, w, sets, tolerance, settled) -> Iterator[tuple[Entered | None, ChangedEnd | None, tuple | None]]:
    """Yield the branches of all changes at the ends of the point ``w``, in every order; None for one without a place to spare.

    With each comes the place at the end alone, if one change has come in at an end of all rows; and if only one system changes, the
    number of its rows and its own number.

    Parameters
    ----------
    c : MpccFunctions
    w : array
    sets : ActiveSets
        at this point
    tolerance : float
        of gauges that are zero
    settled : callable
        takes zero sides and returns them without sides that other pairs decide
    """
    if not c.arrivals:
        return
    at_end, by_row, as_it_is = np.abs(c.measured(w)) <= tolerance, {}, settled(sets.zero)
    for arrival in c.arrivals:
        toggled = (change for change in _toggled(arrival, sets, at_end) if np.any(settled(_changed(sets.zero, change)) != as_it_is))
        changes = [*toggled, *_optional(arrival, sets, at_end)]
        if changes:
            by_row.setdefault(id(arrival.rows), (arrival.rows, []))[1].append(changes)
    for rows, present in by_row.values():
        for sequence, system in _sequences(present):
            alone = None if system is None else (id(rows), system)
            yield _entered(rows, sequence, sets, w), _changed_end(rows, sequence, sets), alone


def _sequences(present) -> Iterator[tuple]:
    """Each change alone with the number of its system, then, with None, those of all systems together, and those of two systems one
    after the other; of many systems without the last."""
    yield from (((change,), system) for system, changes in enumerate(present) for change in changes)
    if len(present) > FEW:
        yield from (((sum(some[1:], some[0]),), None) for some in zip(*present))
    elif len(present) > 1:
        yield from (((sum(some[1:], some[0]),), None) for some in product(*present))
        for first, second in permutations(present, 2):
            yield from ((both, None) for both in product(first, second))


def _toggled(arrival, sets, at_end) -> Iterator[_Change]:
    """The changes of the pairs of one system of which at least one has arrived at its surface."""
    toggles = [t for t in arrival.toggles if _agree(t.pairs, sets)]
    on = [sets.zero[t.pairs[0]] == H_ZERO for t in toggles]
    arrived = [t for t, is_on in zip(toggles, on) if _holds(t.first if is_on else t.second, at_end)]
    with_them = [t for t, is_on in zip(toggles, on) if is_on and t.first is None]
    for some in _some(arrived):
        for rest in [(), *_some(with_them)]:
            yield _flipped([*some, *rest], sets)


def _agree(pairs, sets):
    """Whether pairs have the same zero side for certain."""
    return not (sets.gamma | sets.open)[pairs].any() and len(set(sets.zero[pairs])) == 1


def _holds(gauge, at_end):
    return gauge is not None and bool(at_end[gauge])


def _some(toggles):
    """All that are not empty; of many only each one and all."""
    numbers = range(1, len(toggles) + 1) if len(toggles) <= FEW else (1, len(toggles))
    return [some for number in numbers for some in combinations(toggles, number)]


def _flipped(toggles, sets):
    pairs, sides = [], []
    for t in toggles:
        before = sets.zero[t.pairs[0]]
        after = OTHER[before]
        pairs += [t.pairs, t.with_them]
        sides += [np.full(len(t.pairs), after), np.where(t.swapped, before, after)]
    return _Change(np.concatenate(pairs), np.concatenate(sides), NONE)


def _changed(zero, change):
    """Zero sides with those of a change."""
    zero = zero.copy()
    zero[change.pairs] = change.sides
    return zero


def _optional(arrival, sets, at_end) -> Iterator[_Change]:
    for option in arrival.options:
        if at_end[option.gauges].all() and np.array_equal(sets.zero[option.required], option.required_sides):
            yield _Change(option.pairs, option.sides, option.either)


def _entered(rows, sequence, sets, w):
    """The branch after changes have come in one after the other, the last one next to the end."""
    zero, start, either = sets.zero, w, []
    for change in sequence:
        for row in rows:
            moved = _moved_inwards(row, zero, start, sets.gamma | sets.open)
            if moved is None:
                return None
            zero, start = moved
        zero = _changed(zero, change)
        either.append(change.either)
    extents = [place.extent for row in rows for place in row[: len(sequence)]]
    between = len(rows) == 2 and len(sequence) == 1
    return None if None in extents else Entered(np.array(extents), zero, start, np.concatenate(either), between)


def _changed_end(rows, sequence, sets):
    """The place at an end with its change; None with more changes than one, at an end between two rows, and without places."""
    (row, *others), (change, *more) = rows, sequence
    if others or more or len(row) < 2 or None in (row[0].extent, row[1].extent):
        return None
    zero = _changed(sets.zero, change)
    targets, sources = (np.concatenate(both) for both in zip(*((m.targets, m.sources) for m in (row[1].inside, row[1].between))))
    return ChangedEnd(row[0].extent, row[1].extent, zero, change.pairs, change.either, targets, sources)


def _moved_inwards(row, zero, start, undecided):
    """Zero sides and values with all changes one place further in; None if there is no place to spare."""
    new, at = zero.copy(), start.copy()
    for place, outer in zip(row[1:], row):
        at[place.extent] = start[outer.extent]
        for move in (place.inside, place.between):
            new[move.ended] = G_ZERO
            new[move.targets] = zero[move.sources]
        if not (_differ(place.inside, zero, undecided) or np.any(zero[place.happening] != G_ZERO)):
            at[place.extent] += start[place.extent]
            at[row[0].extent] = 0.0
            return new, at
    return None


def _differ(inside, zero, undecided):
    clear = ~undecided[inside.targets] & ~undecided[inside.sources]
    return bool(np.any((zero[inside.targets] != zero[inside.sources]) & clear))
