"""Sign cubes: the regions of the modes as rows of signs with as many zeros ("does not matter") as possible.

The weights of eq. (6) sum up to 1 at every point, also where several surfaces meet, exactly if each full sign pattern that
can occur *or be touched* belongs to one row.  So a sign may be left out if the row then takes in no touchable pattern that
another one has; patterns that no point touches do not matter.

Takes: the sign matrix as stated, and the patterns that can be touched.
Leaves: the rows with signs left out, whole functions first, since one that no row needs costs nothing.
Does not apply: where a touchable pattern stays with no row, or with two.
"""

import numpy as np


def sign_cubes(signs, touchable):
    """The rows of S with signs left out; None if they do not cover every touchable pattern exactly once."""
    rows = _fewest_signs(signs, touchable)
    return rows if (_owners(rows, touchable) == 1).all() else None


def not_covered_once(signs, touchable):
    """A touchable pattern that does not belong to exactly one row whichever signs are left out, and to how many it belongs."""
    owners = _owners(_fewest_signs(signs, touchable), touchable)
    return next((pattern, int(number)) for pattern, number in zip(touchable, owners) if number != 1)


def _fewest_signs(signs, touchable):
    rows = np.array(signs)
    if (_owners(rows, touchable) > 1).any():
        return signs
    functions = [(slice(None), k) for k in range(rows.shape[1])]
    single = list(zip(*rows.nonzero()))
    for place in functions + single:
        fewer = rows.copy()
        fewer[place] = 0
        if (_owners(fewer, touchable) <= 1).all():
            rows = fewer
    return [tuple(map(int, row)) for row in rows]


def _owners(rows, patterns):
    """To how many rows each pattern belongs."""
    rows = np.array(rows)[:, None, :]
    return ((rows == 0) | (rows == np.array(patterns))).all(axis=2).sum(axis=0)


def merged(rows):
    """The same patterns in fewer rows: two that differ in one sign only become one without it."""
    for a in rows:
        for b in rows:
            differing = [k for k, (s, r) in enumerate(zip(a, b)) if s != r]
            if len(differing) == 1 and a[differing[0]] == -b[differing[0]]:
                both = tuple(0 if k == differing[0] else s for k, s in enumerate(a))
                return merged([both, *(row for row in rows if row not in (a, b))])
    return rows
