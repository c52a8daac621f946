"""The values of a part of no extent at an end of a chain (theory, section 4, orders).

What the part e at the end holds goes to a copy of the part i beside it, with its values and its extent:

    first end:   e (0)  ->  copy of i  ->  i            last end:   i  ->  copy of i  ->  e (0)

So e itself, with extent 0 and the sides of the order, keeps what only an end has: first values that are given, and conditions on
the last ones.

Takes: a point, the parts e and i, the sides of e, and which pairs of i mean the same as those of e.
Leaves: the points at which the parts are linearised.
Does not apply: where i has not the equations that e has: other data, or variables shared with others.
"""

from dataclasses import dataclass

import numpy as np

from pyomo_fesd.mpcc.subproblems.active_set import FREE
from pyomo_fesd.mpcc.subproblems.inserted_copy import Copy, Insertion
from pyomo_fesd.mpcc.subproblems.inserted_part import InsertedPart
from pyomo_fesd.mpcc.subproblems.lpec import sizes_of

#: Residual up to which the copy holds what the part at the end held.
SAME = 1e-6


@dataclass(frozen=True)
class EndInsertion:
    """A part at an end that gives its place to a part of no extent.

    Attributes
    ----------
    end, inner : int
        the parts e and i
    zero : int array (q)
        zero sides of the order, of which those of e count
    targets, sources : int arrays
        pairs of i, and those of e that mean the same
    """

    end: int
    inner: int
    zero: np.ndarray
    targets: np.ndarray
    sources: np.ndarray

    @property
    def is_first(self):
        """Whether the end is the first one of its chain."""
        return self.end < self.inner

    def as_inner(self, zero):
        """Zero sides in which the pairs of i have those of e."""
        found = zero.copy()
        found[self.targets] = zero[self.sources]
        return found


class EndValues:
    """The values of one insertion at an end of the point ``w``.

    Attributes
    ----------
    zero : int array (q)
        zero sides, with those of the order for e
    vanished : Copy
        that gives the values of e at the limit
    held : array (n)
        the point with what e held in place of the values of i
    here : array (n)
        the point with e at the limit
    of_inner, of_end : int arrays
        variables of i and e that mean the same
    ends : int array
        those of i at its end
    copied : Insertion
        the copy of i
    """

    def __init__(self, c, sides, parts, w, sets, order):
        self._c, self._sides, self._parts, self.w, self.order = c, sides, parts, w, order
        self._e, self._i = parts.all[order.end], parts.all[order.inner]
        # a pair that changes with e but belongs to no part, as one at given first values, may have any side
        elsewhere = np.where(order.zero == sets.zero, sets.zero, FREE)
        self.zero = np.where(parts.of_pair == order.end, order.zero, elsewhere)
        held = order.as_inner(sets.zero)
        self.copied = Insertion(order.inner, order.is_first, held, self.zero, (order.inner,))
        both = (self._e.places >= 0) & (self._i.places >= 0)
        self.of_inner, self.of_end, self.ends = self._i.places[both], self._e.places[both], self._i.ends
        if order.is_first:
            vanished = Insertion(order.end, True, self.zero, sets.zero, (order.end, order.inner))
        else:
            # its own equations may hold conditions on its last values; those of i at its end do not
            vanished = Insertion(order.inner, False, order.as_inner(self.zero), held, (order.inner,))
        self.vanished, self._guesses = Copy(parts.of_copies, sides, parts, vanished), vanished.guesses
        self.held = self.here = None

    def solve(self) -> bool:
        """Find the values; whether there are any, and the copy holds what e held."""
        first, e, i = self.order.is_first, self._e, self._i
        held = self.w.copy()
        held[self.of_inner] = self.w[self.of_end]
        if not first:
            held[i.first] = self.w[i.last]
            held = self._completed(held)
        self.held = held
        if not self.vanished.solve(self.base, self._guesses):
            return False
        self.here = self.w.copy()
        self.here[self.of_end] = self.vanished.limit[self.of_end if first else self.of_inner]
        self.here[e.extent] = 0.0
        # the limit is extrapolated; first and last values are the same now
        self.here[e.own] = self._equations(self.order.end, np.setdiff1d(e.own, [e.extent]), self.zero).nearest(self.at_end)[e.own]
        if first:
            held[i.first] = self.here[i.first]
            self.held = held = self._completed(held)
        return self._equations(self.order.inner, i.own, self.copied.zero).missed(held) <= SAME

    @property
    def base(self):
        """The point beside which e vanishes."""
        return self.w if self.order.is_first else self.held

    def contradicts_itself(self) -> bool:
        """Whether the equations of e have no solution at the end, however small its extent is."""
        return self.base is not None and self.vanished.contradicts_itself(self.base, self._guesses)

    def _completed(self, held):
        """``held`` with values that e has not, and the extent: that of i need not have the same unit."""
        columns = np.append(np.setdiff1d(self._i.own, self.of_inner), self._i.extent)
        return self._equations(self.order.inner, columns, self.copied.zero).nearest(held)

    @property
    def unit(self):
        """The extent of i that is as long as a unit of that of e."""
        return self.held[self._i.extent] / self.w[self._e.extent]

    def _equations(self, k, columns, zero):
        c, rows = self._c if k == self.order.end else self._parts.of_copies, np.flatnonzero(self._parts.of_row == k)
        return InsertedPart(c, self._sides, self._parts, columns, rows, zero)

    @property
    def extent(self):
        """That of e."""
        return self._e.extent

    @property
    def points(self):
        """Those at which the gradients of ``JoinedAtEnd`` are taken."""
        return self.w, self.here, self.at_end, self.held

    @property
    def at_end(self):
        """The point at which the equations of e are linearised: it begins where the copy ends."""
        if self.order.is_first:
            return self.here
        found = self.here.copy()
        found[self._i.last] = self.held[self._i.last]
        return found

    def limits(self, radius) -> tuple:
        """Bounds of the rows and of the variables of the copy for a direction from its values, and the reach of the variables."""
        own, w, c = self._i.own, self.held, self._parts.of_copies
        low, high = self._copy.distances(w)
        reach = radius * sizes_of(w[own])
        still = np.isin(own, self._copy.fixed)
        lower = np.where(still, 0.0, np.maximum(c.lbx[own] - w[own], -reach))
        upper = np.where(still, 0.0, np.minimum(c.ubx[own] - w[own], reach))
        return np.minimum(low, 0.0), np.maximum(high, 0.0), np.minimum(lower, 0.0), np.maximum(upper, 0.0), reach

    @property
    def fixed(self):
        """Variables of the copy, and among its first values, that do not move as sides are zero."""
        return self._copy.fixed

    @property
    def _copy(self):
        return Copy(self._parts.of_copies, self._sides, self._parts, self.copied)
