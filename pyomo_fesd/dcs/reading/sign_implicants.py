"""Sign implicants: the regions of the modes as rows of signs with as many zeros ("does not matter") as possible.

The weights of eq. (6) sum up to 1 at every point, also where several boundaries meet, exactly if each full sign pattern that can
occur *or be touched* belongs to one row.  So a sign may be left out if the row then takes in no touchable pattern that another
one has; patterns that no point touches do not matter.

Takes: the sign matrix as stated, and the patterns that can be touched.
Leaves: the rows with signs left out, whole functions first, since a function that no row needs costs nothing.
Does not apply: where a touchable pattern belongs to no row, or to two.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

#: So many sign matrices are remembered: a Disjunction has one, which is read before and after its discretisation.
MOST_MATRICES = 256


@dataclass(frozen=True)
class SignImplicants:
    """An exact cover of the touchable patterns.

    Attributes
    ----------
    used : list of int
        positions of the functions that some mode needs
    rows : list of tuples
        the signs of these functions, one row a mode; 0 where the sign does not matter
    touchable : list of tuples
        the touchable patterns of these functions
    """

    used: list
    rows: list
    touchable: list
    _found: dict = field(default_factory=dict, repr=False)

    def covering(self, modes):
        """Return rows that cover the same patterns as some ``modes`` (a frozenset of numbers), in fewer rows and signs."""
        if modes not in self._found:
            self._found[modes] = _merged([row for i, row in enumerate(self.rows) if i in modes], np.array(self.touchable))
        return self._found[modes]

    def weighing(self, modes, number):
        """Return rows whose weights add up to that of some ``modes`` out of a ``number``."""
        if (modes, number) not in self._found:
            # the other side of one function is shorter
            others = self.covering(frozenset(range(number)) - modes)
            opposite = len(others) == 1 and sum(map(abs, others[0])) == 1
            rows = [tuple(-sign for sign in others[0])] if opposite else self.covering(modes)
            self._found[modes, number] = rows
        return self._found[modes, number]


def sign_implicants(signs, touchable):
    """Return the rows of a sign matrix with signs left out; None if they do not cover every touchable pattern exactly once."""
    return _implicants(tuple(signs), tuple(touchable))


@lru_cache(MOST_MATRICES)
def _implicants(signs, touchable):
    rows = _fewest_signs(signs, touchable)
    if (_owners(rows, touchable) != 1).any():
        return None
    used = np.flatnonzero(rows.any(axis=0))
    return SignImplicants(used.tolist(), _tuples(rows[:, used]), _tuples(np.unique(np.array(touchable)[:, used], axis=0)))


def not_covered_once(signs, touchable):
    """Return a touchable pattern that does not belong to exactly one row, and the number of rows that it belongs to."""
    owners = _owners(_fewest_signs(signs, touchable), touchable)
    return next((pattern, int(number)) for pattern, number in zip(touchable, owners) if number != 1)


def _fewest_signs(signs, touchable):
    rows = np.array(signs)
    if (_owners(rows, touchable) > 1).any():
        return rows
    functions = [(slice(None), k) for k in range(rows.shape[1])]
    single = list(zip(*rows.nonzero()))
    for entry in functions + single:
        fewer = rows.copy()
        fewer[entry] = 0
        if (_owners(fewer, touchable) <= 1).all():
            rows = fewer
    return rows


def _owners(rows, patterns):
    """The number of rows that each pattern belongs to."""
    return np.sum([_inside(row, np.array(patterns)) for row in rows], axis=0)


def _inside(row, patterns):
    """Whether each pattern belongs to a row."""
    return ((np.array(row) == 0) | (patterns == row)).all(axis=1)


def _merged(rows, patterns):
    """Join disjoint rows as long as one row covers two of them exactly."""
    for k, a in enumerate(rows):
        for b in rows[:k]:
            both = _inside(a, patterns) | _inside(b, patterns)
            row = np.where((patterns[both] == patterns[both][0]).all(axis=0), patterns[both][0], 0)
            if (_inside(row, patterns) == both).all():
                return _merged([_shortest(row, patterns), *(r for r in rows if r not in (a, b))], patterns)
    return rows


def _shortest(row, patterns):
    """Drop the signs of a row that follow from its others."""
    inside = _inside(row, patterns)
    for k in range(len(row)):
        fewer = np.where(np.arange(len(row)) == k, 0, row)
        if (_inside(fewer, patterns) == inside).all():
            row = fewer
    return tuple(row.tolist())


def _tuples(array):
    return [tuple(row) for row in array.tolist()]
