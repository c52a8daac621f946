"""Conditions that only one part has on its last values, as those at the final time.

A copy of the part ahead of it does not end there; one behind it takes them over (``joined_lpec``).

A row or a pair of a part is such a condition if it contains of the part's variables only last ones, and no part beside has as many
of the same form: of the same quantities, and for rows between the same bounds in the model's units.  The bounds of a last value are
one if no part beside has them for the same quantity.

Takes: a compiled MPCC and its ``Parts``.
Leaves: the MPCC as copies of its parts have it.
"""

from collections import Counter

import numpy as np

#: Bounds are compared with so many digits.
DIGITS = 9


class WithoutEndConditions:
    """An MPCC in which rows that are conditions on last values of one part have no bounds, and such bounds of variables neither.

    All else is that of the MPCC ``c``, also where that changes.

    Attributes
    ----------
    is_condition : bool array (m)
        whether a row is such a condition
    is_bounded : bool array (n)
        whether the bounds of a variable are
    parts_with_pairs : frozenset of int
        the parts that have such conditions among their pairs
    """

    def __init__(self, c, parts):
        self._c = c
        conditions = _Conditions(c, parts)
        self.is_condition, self.is_bounded = conditions.of_rows(), conditions.of_bounds()
        self.parts_with_pairs = frozenset(parts.of_pair[conditions.of_pairs()].tolist())

    def __getattr__(self, name):
        return getattr(self._c, name)

    @property
    def lbg(self):
        """Lower bounds of the rows."""
        return np.where(self.is_condition, -np.inf, self._c.lbg)

    @property
    def ubg(self):
        """Upper bounds of the rows."""
        return np.where(self.is_condition, np.inf, self._c.ubg)

    @property
    def lbx(self):
        """Lower bounds of the variables."""
        return np.where(self.is_bounded, -np.inf, self._c.lbx)

    @property
    def ubx(self):
        """Upper bounds of the variables."""
        return np.where(self.is_bounded, np.inf, self._c.ubx)


class _Conditions:
    """Finds the conditions, as masks."""

    def __init__(self, c, parts):
        self._c, self._parts = c, parts
        self._quantity = np.zeros(len(c.x0), dtype=int)
        for part in parts.all:
            (is_free,) = np.nonzero(part.places >= 0)
            self._quantity[part.places[is_free]] = is_free

    def of_rows(self):
        """Which rows (m) are conditions on last values of one part."""
        c, m = self._c, len(self._c.lbg)
        pattern, of_row = self._parts.pattern[:m], self._parts.of_row[:m]
        low, high = _rounded(c.lbg / c.scale.g), _rounded(c.ubg / c.scale.g)
        among = self._of_last_values(pattern, of_row)
        return self._alone(of_row, among, lambda i: (self._quantities(pattern, i, of_row), low[i], high[i]))

    def of_pairs(self):
        """Which pairs (q) are."""
        m, q, of_pair = len(self._c.lbg), self._c.pairs, self._parts.of_pair
        G, H = (self._parts.pattern[first : first + q] for first in (m, m + q))
        among = self._of_last_values(G + H, of_pair)
        return self._alone(of_pair, among, lambda i: tuple(self._quantities(sides, i, of_pair) for sides in (G, H)))

    def of_bounds(self):
        """Of which variables (n) the bounds are."""
        c, of_variable = self._c, self._parts.of_variable
        low, high = _rounded(c.lbx / c.scale.x), _rounded(c.ubx / c.scale.x)
        among = self._parts.is_last & (np.isfinite(c.lbx) | np.isfinite(c.ubx))
        return self._alone(of_variable, among, lambda j: (self._quantity[j], low[j], high[j]))

    def _of_last_values(self, pattern, of_row):
        """Which rows contain of the variables of their part only last ones."""
        entries = pattern.tocoo()
        others = (self._parts.of_variable[entries.col] == of_row[entries.row]) & ~self._parts.is_last[entries.col]
        return np.bincount(entries.row, others, pattern.shape[0]) == 0

    def _quantities(self, pattern, i, of_row):
        """Those of its part that row ``i`` contains."""
        columns = pattern.indices[pattern.indptr[i] : pattern.indptr[i + 1]]
        return tuple(sorted(self._quantity[columns[self._parts.of_variable[columns] == of_row[i]]].tolist()))

    def _alone(self, of, among, form):
        """Which of those ``among`` have a form of which no part beside their own has as many; ``of`` are the parts of all."""
        some = np.flatnonzero(among & (of >= 0)).tolist()
        kinds = [(int(of[i]), form(i)) for i in some]
        count, found = Counter(kinds), np.zeros(len(of), dtype=bool)
        for i, (k, kind) in zip(some, kinds):
            found[i] = all(count[other, kind] != count[k, kind] for other in self._parts.beside(k))
        return found


def _rounded(numbers):
    return [float(f'{number:.{DIGITS}g}') for number in numbers]
