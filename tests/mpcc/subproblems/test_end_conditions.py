"""Which rows, bounds and pairs are conditions on the last values of one part, for a chain of three parts written by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import sparse

from pyomo_fesd.mpcc.compile.hint_indices import PartIndices
from pyomo_fesd.mpcc.subproblems.parts import Parts

#: Variable 0 belongs to no part; each part has its extent, an inner value, and two last values, a and b.
EXTENT, INNER, A, B = range(4)


def of(part, *values):
    """Numbers of some values of a part."""
    return [1 + 4 * part + value for value in values]


#: Columns, lower and upper bound of the rows, and whether each is a condition on the last values of one part.
ROWS = {
    'equation of part 0': (of(0, INNER, A), 0.0, 0.0, False),
    'equation of part 1': (of(0, A) + of(1, EXTENT, INNER, A), 0.0, 0.0, False),
    'path constraint of part 0': (of(0, A), -1.0, np.inf, False),
    'path constraint of part 1': (of(1, A), -1.0, np.inf, False),
    'path constraint of part 2': (of(2, A), -1.0, np.inf, False),
    'condition at the end': (of(2, B), 0.5, np.inf, True),
    'equation at the end with a variable of no part': ([0] + of(2, A), 0.0, 0.0, True),
    'condition on the last two ends': (of(1, A) + of(2, A), -np.inf, 3.0, True),
    'condition inside the last part': (of(2, INNER, B), 0.5, np.inf, False),
    'condition on two parts that are not beside each other': (of(0, A) + of(2, A), 0.0, 0.0, False),
    'condition without a part': ([0], 0.0, 1.0, False),
}
LOWER = {
    of(0, B)[0]: -2.0,
    of(1, B)[0]: -2.0,
    of(2, B)[0]: -1.0,
    of(1, INNER)[0]: 0.25,
    **dict.fromkeys([of(k, A)[0] for k in range(3)], 0.0),
}
#: Variables whose bounds are conditions: that of part 2, and that of part 1 has the same as part 0.
BOUNDED = of(2, B)


def without(pairs=(), lower=LOWER, scale=1.0):
    """The hand-made MPCC as copies have it, and the MPCC; ``pairs`` are the columns of both sides."""
    own = [np.arange(1 + 4 * k, 5 + 4 * k) for k in range(3)]
    parts = [
        PartIndices(
            extent=v[EXTENT], own=v, gate=v[:0], places=v, first=v[A:] - 4 if k else v[:0], last=v[A:] if k else v[:0],
            ends=v[A:], chain=0, number=k, alike=True, whole=True, copies=True,
        )
        for k, v in enumerate(own)
    ]  # fmt: skip
    columns = [row[0] for row in ROWS.values()] + [G for G, _ in pairs] + [H for _, H in pairs]
    J = np.zeros((len(columns), 13))
    for row, entries in zip(J, columns):
        row[entries] = 1.0
    lbx = np.full(13, -np.inf)
    lbx[list(lower)] = list(lower.values())
    c = SimpleNamespace(parts=parts, x0=np.zeros(13), pairs=len(pairs), lbx=lbx * scale, ubx=np.full(13, np.inf))
    c.lbg, c.ubg = (np.array([row[side] for row in ROWS.values()]) for side in (1, 2))
    c.scale = SimpleNamespace(g=np.ones(len(ROWS)), x=np.full(13, scale))
    c.stacked_jacobian = lambda w: sparse.csr_matrix(J)
    return Parts(c), c


@pytest.mark.parametrize('name', ROWS)
def test_rows_on_last_values_of_one_part_have_no_bounds_in_copies(name):
    parts, c = without()
    i, condition = list(ROWS).index(name), ROWS[name][-1]
    assert parts.of_copies.is_condition[i] == condition
    bounds = (-np.inf, np.inf) if condition else (c.lbg[i], c.ubg[i])
    assert (parts.of_copies.lbg[i], parts.of_copies.ubg[i]) == bounds


@pytest.mark.parametrize('scale', [1.0, 1e-4, 3e3])
def test_bounds_that_no_part_beside_has_are_none_in_copies(scale):
    parts, c = without(scale=scale)
    assert np.flatnonzero(parts.of_copies.is_bounded).tolist() == BOUNDED
    others = np.setdiff1d(np.arange(13), BOUNDED)
    assert np.array_equal(parts.of_copies.lbx[others], c.lbx[others])
    assert parts.of_copies.lbx[BOUNDED] == -np.inf


def test_a_value_without_bounds_has_no_condition():
    lower = {j: low for j, low in LOWER.items() if j != BOUNDED[0]}
    assert not without(lower=lower)[0].of_copies.is_bounded[BOUNDED[0]]


def test_bounds_are_those_of_the_moment():
    parts, c = without()
    at_first = parts.of_copies.lbx
    c.lbx = c.lbx - 1.0
    assert np.array_equal(parts.of_copies.lbx, at_first - 1.0)


@pytest.mark.parametrize(
    'pairs, ends',
    [
        ([], []),
        ([(of(2, A), [0])], [2]),
        ([(of(1, A), [0]), (of(2, A), [0])], []),
        ([(of(1, A), [0]), (of(2, B), [0])], [1, 2]),
        ([(of(2, INNER), of(2, A))], []),
    ],
)
def test_parts_with_pairs_on_their_last_values_alone_are_known(pairs, ends):
    parts, _ = without(pairs)
    assert [k for k in range(3) if parts.ends_with_pairs(k)] == ends


def test_all_else_is_that_of_the_mpcc():
    parts, c = without()
    assert parts.of_copies.stacked_jacobian is c.stacked_jacobian
    assert parts.of_copies.x0 is c.x0
