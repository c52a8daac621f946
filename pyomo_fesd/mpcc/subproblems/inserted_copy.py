"""The limit of an inserted part as its extent goes to zero, and whether its bounds hold there.

Takes: a point, and the zero sides of the copy.
Leaves: the values at two small extents and at the limit.
Does not apply: where the values have no limit, as a force that stops a body at once.
"""

from dataclasses import dataclass

import numpy as np

from pyomo_fesd.mpcc.subproblems.inserted_part import InsertedPart
from pyomo_fesd.mpcc.subproblems.lpec import sizes_of

#: Extents of the copy, relative to the extent of its part, and their ratio.
EXTENTS, RATIO = (1e-2, 1e-3), 0.1
#: A limit exists if values differ by less than this, relative, over the two extents.
NEAR = 0.2
#: A bound that is missed by more than this, relative to the terms of its row, does not hold at the limit either.
CLEAR = 1e-3
#: A distance from a bound that shrinks by this factor or more is zero at the limit.
SHRINKS = 0.5
#: Smaller distances, relative, are round-off; a surface is not missed by more where a point lies on it.
ROUND_OFF, MISSED = 1e-9, 1e-6
#: Orders in the extent with which a bound may be missed.
ORDERS = 1, 2, 3


@dataclass(frozen=True)
class Insertion:
    """A copy of a part, and where it is inserted.

    Attributes
    ----------
    k : int
        the part that is copied
    ahead : bool
        whether the copy lies before part k, or after it
    zero : int array (q)
        zero sides, of which those of part k are the copy's
    zero_beside : int array (q)
        zero sides of all others
    guesses : tuple of int
        parts whose values to start from
    """

    k: int
    ahead: bool
    zero: np.ndarray
    zero_beside: np.ndarray
    guesses: tuple


class Copy:
    """A copy of a part.

    Parameters
    ----------
    c : MpccFunctions or WithoutEndConditions
    sides : Sides
    parts : Parts
    insertion : Insertion
    is_first : bool
        whether it begins with the last values of a part, and not with those of another copy

    Attributes
    ----------
    part : PartIndices
    own : int array
        the variables of the part
    rows : int array
        stacked numbers of its rows
    limit : array (n)
        the point with the values of the copy, at the limit, in place of those of the part
    """

    def __init__(self, c, sides, parts, insertion, is_first=True):
        self._c, self._sides, self._parts, self._insertion, self._is_first = c, sides, parts, insertion, is_first
        self.part, self.rows = parts.all[insertion.k], np.flatnonzero(parts.of_row == insertion.k)
        self.own, self._inner = self.part.own, np.setdiff1d(self.part.own, [self.part.extent])
        self._equations = InsertedPart(c, sides, parts, self._inner, self.rows, insertion.zero)
        # with which the part begins, and what takes its place at its end
        self._before_it, self._at_end = parts.entry(insertion.k)
        self._at, self.limit = [], None

    def solve(self, w, guesses, size=None) -> bool:
        """Find the values beside the point ``w``, from those of one of the parts ``guesses``, at extents relative to ``size``.

        ``size`` is the extent of the part, unless it is given.
        """
        size = w[self.part.extent] if size is None else size
        return any(self.follow(self._on_surfaces(self._start(w, guess)), size) for guess in guesses)

    def follow(self, start, size) -> bool:
        """Find the values as the extent goes to zero, from those of ``start``, at extents relative to ``size``."""
        self._at = []
        for extent in EXTENTS:
            start = start.copy()
            start[self.part.extent] = extent * size
            start = self._equations.solve(start, any_of=True)
            if start is None:
                return False
            self._at.append(start)
        if not self._has_limit():
            return False
        self.limit = _limit(*self._at)
        self.limit[self.part.extent] = 0.0
        return True

    def after(self, w):
        """The point ``w`` with the values at the boundary that the copy has at its end."""
        found = w.copy()
        found[self._before_it if self._insertion.ahead else self._at_end] = self.limit[self._at_end]
        return found

    @property
    def determined(self):
        """Whether its equations determine its values; else they are those beside the values that it started from."""
        return self._equations.determined

    def _start(self, w, guess):
        """Values of part ``guess``, its last ones those with which the copy begins."""
        part, start = self.part, w.copy()
        if not self._insertion.ahead:
            start[self._before_it] = w[self._at_end]
        given = self._parts.all[guess].own
        if len(given) == len(part.own):
            start[part.own] = w[given]
        start[part.last] = start[part.first]
        return start

    def _on_surfaces(self, start):
        """``start`` with first values for which the zero sides can hold without extent, if these are as near as round-off.

        A slide on a surface that the point misses by d has rates of d / h, which have no limit.
        """
        first, found = self.part.first, start.copy()
        found[self.part.extent] = 0.0
        # all that its own variables can do first, so that the first values move only where they must
        for columns in (self._inner, np.union1d(self._inner, first)):
            rows = InsertedPart(self._c, self._sides, self._parts, columns, self.rows, self._insertion.zero)
            found = rows.nearest(found)
        if np.any(np.abs(found - start)[first] > MISSED * sizes_of(start[first])):
            return start
        start = start.copy()
        start[first] = found[first]
        return start

    def _has_limit(self):
        determined = self._inner[~self._parts.is_gate[self._inner]]
        long, short = (w[determined] for w in self._at)
        return bool(np.all(np.abs(long - short) <= NEAR * np.maximum(1.0, np.abs(short))))

    def contradicts_itself(self, w, guesses) -> bool:
        """Whether its equations have no solution beside the point ``w``, however small the extent is."""
        starts = [self._start(w, guesses[0]) for _ in EXTENTS]
        for start, extent in zip(starts, EXTENTS):
            start[self.part.extent] = extent * w[self.part.extent]
        if all(map(self._equations.contradict, starts)):
            return True
        return any(self._contradicts_by_order(w, starts, others) for others in (self.part.first[:0], self.part.first))

    def _contradicts_by_order(self, w, starts, others):
        """Whether what contradicts itself, whatever ``others`` are, is a power of the extent that nothing beside can change."""
        found = [self._equations.contradiction(start, others) for start in starts]
        if None in found:
            return False
        (long, by_long), (short, by_short) = found
        return self._is_fixed_by_order(w, long / short, (by_long, by_short))

    # bounds

    def impossible(self, w) -> bool:
        """Whether a bound of the copy does not hold beside the point ``w``, however small the extent is."""
        long, short = (self._missed(at) for at in self._at)
        if any(map(self._knows, self._clear(long, short))):
            return True
        rows = np.flatnonzero((short > ROUND_OFF) & (short <= SHRINKS * long))
        return any(self._misses_by_order(w, k, long[k] / short[k]) for k in rows if k < len(self.rows) and self._knows(k))

    def misses(self) -> bool:
        """Whether its values miss a bound, which other ones might not where they are not determined."""
        return bool(len(self._clear(*(self._missed(at) for at in self._at))))

    @staticmethod
    def _clear(long, short):
        return np.flatnonzero(np.minimum(short, _limit(long, short)) > CLEAR)

    def _knows(self, k):
        """Whether the equations determine row ``k`` of the copy, or its variable."""
        return self.determined or (k < len(self.rows) and self._equations.determine(self._at[-1], self.rows[k]))

    def _misses_by_order(self, w, k, ratio):
        """Whether row ``k`` misses its bound by a power of the extent, and nothing beside the point can change that."""
        return self._is_fixed_by_order(w, ratio, [self._equations.slopes(at, self.rows[k]) for at in self._at])

    def _is_fixed_by_order(self, w, ratio, slopes):
        """Whether a value with this ratio over both extents is a power of the extent, and all of a lower power in it is fixed.

        The part with which the copy begins must fix it.  Before the first part there is nothing that could change it.
        """
        order = next((p for p in ORDERS if 0.5 < ratio * RATIO**p < 2.0), None)
        if order is None:
            return False
        before, slopes = self._before(), [self._at_entry(slope) for slope in slopes]
        left = [np.abs(slope).max() if before is None else before.left_free(w, slope) for slope in slopes]
        return left[1] <= max(2.0 * RATIO**order * left[0], ROUND_OFF)

    def _before(self):
        """The equations of the part whose last values the copy begins with; None without one, and after another copy."""
        k = self._insertion.k
        if self._insertion.ahead:
            k = self._parts.previous(k)
        if k is None or not self._is_first:
            return None
        rows = np.flatnonzero(self._parts.of_row == k)
        return InsertedPart(self._c, self._sides, self._parts, self._parts.all[k].own, rows, self._insertion.zero_beside)

    def _at_entry(self, slopes):
        """Slopes by the variables of the model beside the copy, with the last ones before it for its first ones."""
        found = slopes.copy()
        found[self.part.extent] = 0.0
        if self._insertion.ahead:
            return found
        found[self._before_it] = 0.0
        found[self._at_end] = slopes[self._before_it]
        return found

    def _missed(self, w):
        """By how much the copy misses the bounds of its rows and sides, and of its variables, relative to their terms."""
        low, high = self.distances(w)
        terms = np.maximum(1.0, abs(self._c.stacked_jacobian(w)[self.rows]) @ np.abs(w))
        own, inner = self._c, self._inner
        of_variables = np.maximum(own.lbx[inner] - w[inner], w[inner] - own.ubx[inner]) / sizes_of(w[inner])
        return np.concatenate([np.maximum(low, -high) / terms, of_variables])

    def distances(self, w):
        """Distances to the lower and upper bounds of rows of the copy; zero sides have both."""
        c, q, at = self._c, self._c.pairs, self._c.evaluate(w)
        none = np.zeros(c.equal.numel())
        values = np.concatenate([at.g, at.G, at.H, none])
        high = np.concatenate([c.ubg, np.where(self._sides.zero_rows(self._insertion.zero), 0.0, np.inf), none + np.inf])
        low = np.concatenate([c.lbg, np.zeros(2 * q), none - np.inf])
        return (low - values)[self.rows], (high - values)[self.rows]

    def limits(self, radius) -> tuple:
        """Bounds of the rows and of the variables for a direction from the limit, and the reach of the variables."""
        c, own = self._c, self.own
        low, high = (_at_limit(*both) for both in zip(*map(self.distances, self._at)))
        lower, upper = (_at_limit(*both) for both in zip(*((c.lbx[own] - w[own], c.ubx[own] - w[own]) for w in self._at)))
        reach = radius * sizes_of(self.limit[own])
        still, extent = np.isin(own, self.fixed), own == self.part.extent
        lower, upper = np.where(still, 0.0, np.maximum(lower, -reach)), np.where(still, 0.0, np.minimum(upper, reach))
        lower[extent], upper[extent] = 0.0, radius
        return np.minimum(low, 0.0), np.maximum(high, 0.0), np.minimum(lower, 0.0), np.maximum(upper, 0.0), reach

    @property
    def fixed(self):
        """Variables of the part, and among its first values, that do not move as sides are zero."""
        return self._sides.fixed_by(self._insertion.zero, self._parts.of_pair == self._insertion.k)


def _limit(long, short):
    with np.errstate(invalid='ignore'):
        return short + (short - long) * RATIO / (1 - RATIO)


def _at_limit(long, short):
    """Distances to bounds as the extent goes to zero, of those at two extents."""
    vanish = (np.abs(short) <= SHRINKS * np.abs(long)) & np.isfinite(short)
    return np.where(vanish, 0.0, short)
