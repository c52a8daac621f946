"""Which rows and pairs of a compiled MPCC belong to which of its parts.

A row belongs to a part if it contains variables of the part, and besides them only last values of the part before, what that one
hands on, and variables that belong to no part.  A row with variables of more parts is shared.  The sides of a pair belong to the
same part.

A part hands on a quantity inside it if a row of every next part contains that of the part before it, but not the extent of that
part: as forces do of which depends how the next element begins.

Takes: a compiled MPCC with ``parts``, and the pattern of its Jacobians.
Leaves: numbers of parts by variable, row and pair.
"""

from functools import cached_property

import numpy as np

from pyomo_fesd.mpcc.compile import with_entries
from pyomo_fesd.mpcc.subproblems.end_conditions import WithoutEndConditions

#: Instead of the number of a part: of none, and of several.
NONE, SHARED = -1, -2
#: Parts that are shorter than this, relative to the longest one beside them, have nearly no extent.
SHORT = 0.01


class Parts:
    """The parts of one compiled MPCC.

    Rows are numbered as in ``stacked_jacobian``: own rows (m), G (q), H (q), decisions.
    """

    def __init__(self, c):
        self._c, self.all = c, c.parts
        self.by_extent = {part.extent: k for k, part in enumerate(c.parts)}

    def may_be_copied(self, k):
        """Whether copies of part ``k`` may be inserted; where amounts lie in fillings depends on all extents before them."""
        return self.all[k].copies and not self._c.fillings

    def next(self, k):
        """The number of the part after part ``k``; None without one."""
        if k + 1 == len(self.all):
            return None
        part, other = self.all[k], self.all[k + 1]
        return k + 1 if (other.chain, other.number) == (part.chain, part.number + 1) else None

    def previous(self, k):
        """The number of the part before part ``k``; None without one."""
        return k - 1 if k > 0 and self.next(k - 1) == k else None

    def beside(self, k):
        """The numbers of the parts before and after part ``k``, where there are any."""
        return tuple(j for j in (self.previous(k), self.next(k)) if j is not None)

    def is_beside_a_short_one(self, w, k):
        """Whether part ``k`` or one beside it has nearly no extent: what it holds need not be what follows or precedes."""
        beside = self._extents(w, k - 1, k, k + 1)
        return min(beside) < SHORT * max(beside)

    def touches_a_short_one(self, w, k, ahead):
        """Whether one of the two parts that meet at the beginning (``ahead``) or the end of part ``k`` has nearly no extent."""
        return min(self._extents(w, k, k - 1 if ahead else k + 1)) < SHORT * max(self._extents(w, k - 1, k, k + 1))

    def _extents(self, w, *numbers):
        return [w[self.all[j].extent] for j in numbers if 0 <= j < len(self.all)]

    @cached_property
    def of_variable(self):
        """The part of each variable (n)."""
        found = np.full(len(self._c.x0), NONE)
        for k, part in enumerate(self.all):
            found[part.own] = k
        return found

    @cached_property
    def motion(self):
        """The extents of all parts and the values with which they end; all variables without parts.

        Within a part some values are not determined, so that two solutions that agree in these alone may count as one.
        """
        if not self.all:
            return np.arange(len(self._c.x0))
        return np.unique([k for part in self.all for k in (part.extent, *part.last)])

    @cached_property
    def is_gate(self):
        """Whether a variable (n) only says how its part begins."""
        found = np.zeros(len(self._c.x0), dtype=bool)
        for part in self.all:
            found[part.gate] = True
        return found

    @cached_property
    def is_last(self):
        """Whether a variable (n) is at the end of its part."""
        found = np.zeros(len(self._c.x0), dtype=bool)
        for part in self.all:
            found[part.ends] = True
        return found

    @cached_property
    def is_handed_on(self):
        """Whether a variable (n) is handed on to the next part, beside the last values."""
        found = np.zeros(len(self._c.x0), dtype=bool)
        for part in self.all:
            places = part.places[self._handed_on[part.chain]]
            found[places[places >= 0]] = True
        return found

    def entry(self, k):
        """Variables of the part before part ``k`` with which this one begins, and those of its own that follow them."""
        part, before = self.all[k], self.previous(k)
        places = self._handed_on[part.chain]
        if before is None or not len(places):
            return part.first, part.last
        handed_on, own = self.all[before].places[places], part.places[places]
        free = (handed_on >= 0) & (own >= 0)
        return np.append(part.first, handed_on[free]), np.append(part.last, own[free])

    def is_whole(self, k):
        """Whether all with which part ``k`` begins and ends is free."""
        part, before = self.all[k], self.previous(k)
        places = self._handed_on[part.chain]
        if not part.whole or not len(places):
            return part.whole
        return before is not None and bool((self.all[before].places[places] >= 0).all() and (part.places[places] >= 0).all())

    def hands_on(self, k):
        """Whether parts of the chain of part ``k`` hand on more than their last values."""
        return bool(len(self._handed_on[self.all[k].chain]))

    @cached_property
    def _handed_on(self):
        """By chain, the places among the variables of a part that are handed on; where one is given, rows need not contain it."""
        found = {part.chain: set() for part in self.all}
        for part, read in zip(self.all, self._read_before):
            found[part.chain] |= read
        for k, (part, read) in enumerate(zip(self.all, self._read_before)):
            before = self.previous(k)
            if before is not None:
                found[part.chain] -= {place for place in found[part.chain] - read if self.all[before].places[place] >= 0}
        return {chain: np.array(sorted(places), dtype=int) for chain, places in found.items()}

    @cached_property
    def _read_before(self):
        """For each part, the places inside the part before it that its rows contain."""
        pattern, found = self.pattern, [set() for _ in self.all]
        places = np.full(len(self._c.x0), NONE)
        for part in self.all:
            places[part.places[part.places >= 0]] = np.flatnonzero(part.places >= 0)
            places[part.extent] = NONE
        for columns in np.split(pattern.indices, pattern.indptr[1:-1]):
            one, other = self._adjacent(columns)
            if other is not None:
                inner = columns[(self.of_variable[columns] == one) & ~self.is_last[columns]]
                if (places[inner] >= 0).all():
                    found[other].update(places[inner].tolist())
        return found

    @cached_property
    def pattern(self):
        """Ones where a row contains a variable."""
        J = self._c.stacked_jacobian(self._c.x0)
        return with_entries(J, np.ones(J.nnz))

    @cached_property
    def of_row(self):
        """The part of each row; both sides of a pair have the same one."""
        pattern, m, q = self.pattern, len(self._c.lbg), self._c.pairs
        found = np.array([self._part_of(columns) for columns in np.split(pattern.indices, pattern.indptr[1:-1])], dtype=int)
        if q:
            both = pattern[m : m + q] + pattern[m + q : m + 2 * q]
            of_pairs = [self._part_of(columns) for columns in np.split(both.indices, both.indptr[1:-1])]
            found[m : m + 2 * q] = np.tile(np.array(of_pairs, dtype=int), 2)
        return found

    @cached_property
    def of_copies(self):
        """The MPCC as copies of parts have it: without conditions on last values of one part."""
        return WithoutEndConditions(self._c, self)

    def ends_with_pairs(self, k):
        """Whether pairs of part ``k`` are conditions on its last values that no other part has: no copy ends elsewhere."""
        return k in self.of_copies.parts_with_pairs

    @property
    def of_pair(self):
        """The part of each pair."""
        m = len(self._c.lbg)
        return self.of_row[m : m + self._c.pairs]

    @cached_property
    def in_gate(self):
        """Whether a pair contains no variable of its part but those of its gate, and its extent."""
        m, q = len(self._c.lbg), self._c.pairs
        pattern = self.pattern
        inner = self.of_variable >= 0
        inner[self.is_gate | self._is_read_after] = False
        inner[[part.extent for part in self.all]] = False
        counts = pattern @ inner.astype(float)
        own = self._with_own_read_after(pattern)
        return (counts[m : m + q] + counts[m + q : m + 2 * q] == 0) & ~(own[m : m + q] | own[m + q : m + 2 * q])

    @cached_property
    def _is_read_after(self):
        """Whether rows of the next part may contain a variable (n)."""
        return self.is_last | self.is_handed_on

    def _with_own_read_after(self, pattern):
        """Whether a row contains, of the part that it belongs to, what those of the next one may contain."""
        entries = pattern.tocoo()
        hit = self._is_read_after[entries.col] & (self.of_variable[entries.col] == self.of_row[entries.row])
        found = np.zeros(pattern.shape[0], dtype=bool)
        found[entries.row[hit]] = True
        return found

    def _part_of(self, columns):
        owners = self.of_variable[columns]
        parts = np.unique(owners[owners >= 0])
        if len(parts) < 2:
            return parts[0] if len(parts) else NONE
        one, other = self._adjacent(columns)
        return SHARED if other is None or not self._is_read_after[columns[owners == one]].all() else other

    def _adjacent(self, columns):
        """The two parts of variables ``columns`` that are of two parts, one after the other; else (None, None)."""
        parts = np.unique(self.of_variable[columns])
        parts = parts[parts >= 0].tolist()
        return parts if len(parts) == 2 and self.next(parts[0]) == parts[1] else (None, None)
