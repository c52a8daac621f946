"""Sign implicants: which signs matter to which mode, so that the weights of eq. (6) sum up to 1 everywhere."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyomo_fesd.dcs.reading.sign_implicants import not_covered_once, sign_implicants


def every(n):
    return list(itertools.product((1, -1), repeat=n))


def inside(row, pattern):
    return all(sign in (0, p) for sign, p in zip(row, pattern))


def test_what_the_modes_do_not_say_does_not_matter():
    stated = [(1, 1), (1, -1), (-1, 0)]
    assert sign_implicants(stated, every(2)).rows == stated


def test_a_sign_that_follows_from_another_is_left_out():
    # x <= 0, 0 <= x <= 1, x >= 1 with both signs stated by all; x <= 0 and x >= 1 touch nowhere
    touchable = [(-1, -1), (1, -1), (1, 1)]
    assert sign_implicants([(-1, -1), (1, -1), (1, 1)], touchable).rows == [(-1, 0), (1, -1), (0, 1)]


def test_a_function_that_matters_to_no_mode_is_left_out_everywhere():
    # x >= 0 and x >= -1, against x <= 0
    implicants = sign_implicants([(1, 1), (-1, 0)], [(1, 1), (-1, 1), (-1, -1)])
    assert (implicants.used, implicants.rows, sorted(implicants.touchable)) == ([0], [(1,), (-1,)], [(-1,), (1,)])


SECTORS = [(1, 1, 1), (1, -1, 1), (1, -1, -1), (-1, -1, -1), (-1, 1, -1), (-1, 1, 1)]


def test_a_pattern_that_is_touched_only_gets_an_owner():
    # c3 = c1 + c2: the patterns (+, +, -) and (-, -, +) have no point but the origin
    rows = sign_implicants(SECTORS, every(3)).rows
    for pattern in every(3):
        assert sum(inside(row, pattern) for row in rows) == 1
    assert all(inside(row, sector) for row, sector in zip(rows, SECTORS))


def test_where_a_pattern_that_is_touched_only_cannot_get_an_owner_there_are_no_implicants():
    # c3 = c1 + c2 and three sectors round the origin: to take in (+, +, -) each would overlap the next one
    signs = [(1, 0, 1), (-1, 1, 0), (0, -1, -1)]
    assert sign_implicants(signs, every(3)) is None
    assert not_covered_once(signs, every(3)) == ((1, 1, -1), 0)


def test_where_two_modes_touch_the_same_pattern_there_are_no_implicants():
    signs = [(1, 0), (0, 1), (-1, -1)]
    assert sign_implicants(signs, every(2)) is None
    assert not_covered_once(signs, every(2)) == ((1, 1), 2)


QUADRANTS = sign_implicants(every(2), every(2))
INTERVALS = sign_implicants([(-1, 0), (1, -1), (0, 1)], [(-1, -1), (1, -1), (1, 1)])


@pytest.mark.parametrize(
    'implicants, modes, expected',
    [
        (QUADRANTS, {0, 1}, [(1, 0)]),
        (QUADRANTS, {0, 1, 2, 3}, [(0, 0)]),
        (QUADRANTS, {0, 3}, [(1, 1), (-1, -1)]),
        (QUADRANTS, {0, 1, 2}, [(1, 0), (-1, 1)]),
        (QUADRANTS, set(), []),
        (INTERVALS, {0, 1}, [(0, -1)]),
        (INTERVALS, {1, 2}, [(1, 0)]),
        (INTERVALS, {0, 2}, [(-1, 0), (0, 1)]),
    ],
)
def test_modes_together_need_fewer_rows(implicants, modes, expected):
    assert sorted(implicants.covering(frozenset(modes))) == sorted(expected)


@st.composite
def trees(draw, functions=4):
    """Modes from a random tree of decisions, and a random set of patterns that can be touched, one at least of each mode."""

    def split(row):
        open_signs = [k for k, sign in enumerate(row) if sign == 0]
        if not open_signs or not draw(st.booleans()):
            return [row]
        k = draw(st.sampled_from(open_signs))
        return [leaf for sign in (1, -1) for leaf in split((*row[:k], sign, *row[k + 1 :]))]

    modes = draw(st.permutations(split((0,) * functions)))
    touchable = draw(st.sets(st.sampled_from(every(functions))))
    touchable |= {draw(st.sampled_from([p for p in every(functions) if inside(row, p)])) for row in modes}
    return modes, sorted(touchable)


@settings(max_examples=200, deadline=None)
@given(trees())
def test_every_touchable_pattern_stays_with_the_mode_that_had_it(tree):
    stated, touchable = tree
    implicants = sign_implicants(stated, touchable)
    for pattern in touchable:
        owner = [i for i, row in enumerate(stated) if inside(row, pattern)]
        known = [pattern[k] for k in implicants.used]
        assert [i for i, row in enumerate(implicants.rows) if inside(row, known)] == owner
    assert all(sign in (0, of[k]) for row, of in zip(implicants.rows, stated) for k, sign in zip(implicants.used, row))


@settings(max_examples=200, deadline=None)
@given(trees(), st.data())
def test_modes_together_cover_the_patterns_of_each_of_them_once(tree, data):
    implicants = sign_implicants(*tree)
    modes = data.draw(st.frozensets(st.sampled_from(range(len(implicants.rows)))))
    fewer = implicants.covering(modes)
    assert len(fewer) <= len(modes)
    for pattern in implicants.touchable:
        owned = any(inside(implicants.rows[i], pattern) for i in modes)
        assert sum(inside(row, pattern) for row in fewer) == owned
