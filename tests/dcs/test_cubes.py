"""Sign cubes: which signs matter to which mode, so that the weights of eq. (6) sum up to 1 everywhere."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyomo_fesd.dcs.cubes import merged, not_covered_once, sign_cubes


def every(n):
    return list(itertools.product((1, -1), repeat=n))


def inside(row, pattern):
    return all(sign in (0, p) for sign, p in zip(row, pattern))


def test_what_the_modes_do_not_say_does_not_matter():
    stated = [(1, 1), (1, -1), (-1, 0)]
    assert sign_cubes(stated, every(2)) == stated


def test_a_sign_that_follows_from_another_is_left_out():
    # x <= 0, 0 <= x <= 1, x >= 1 with both signs stated by all; x <= 0 and x >= 1 touch nowhere
    touchable = [(-1, -1), (1, -1), (1, 1)]
    assert sign_cubes([(-1, -1), (1, -1), (1, 1)], touchable) == [(-1, 0), (1, -1), (0, 1)]


def test_a_function_that_matters_to_no_mode_is_left_out_everywhere():
    # x >= 0 and x >= -1, against x <= 0
    assert sign_cubes([(1, 1), (-1, 0)], [(1, 1), (-1, 1), (-1, -1)]) == [(1, 0), (-1, 0)]


SECTORS = [(1, 1, 1), (1, -1, 1), (1, -1, -1), (-1, -1, -1), (-1, 1, -1), (-1, 1, 1)]


def test_a_pattern_that_is_touched_only_gets_an_owner():
    # c3 = c1 + c2: the patterns (+, +, -) and (-, -, +) have no point but the origin
    rows = sign_cubes(SECTORS, every(3))
    for pattern in every(3):
        assert sum(inside(row, pattern) for row in rows) == 1
    assert all(inside(row, sector) for row, sector in zip(rows, SECTORS))


def test_where_a_pattern_that_is_touched_only_cannot_get_an_owner_there_are_no_cubes():
    # c3 = c1 + c2 and three sectors round the origin: to take in (+, +, -) each would overlap the next one
    signs = [(1, 0, 1), (-1, 1, 0), (0, -1, -1)]
    assert sign_cubes(signs, every(3)) is None
    assert not_covered_once(signs, every(3)) == ((1, 1, -1), 0)


def test_where_two_modes_touch_the_same_pattern_there_are_no_cubes():
    signs = [(1, 0), (0, 1), (-1, -1)]
    assert sign_cubes(signs, every(2)) is None
    assert not_covered_once(signs, every(2)) == ((1, 1), 2)


@pytest.mark.parametrize(
    'rows, expected',
    [
        ([(1, 1), (1, -1)], [(1, 0)]),
        ([(1, 1), (1, -1), (-1, 1), (-1, -1)], [(0, 0)]),
        ([(1, 1), (-1, -1)], [(1, 1), (-1, -1)]),
        ([(1, 0), (-1, 1)], [(1, 0), (-1, 1)]),
        ([], []),
    ],
)
def test_rows_that_differ_in_one_sign_are_merged(rows, expected):
    assert sorted(merged(rows)) == sorted(expected)


@st.composite
def trees(draw, functions=4):
    """Modes from a random tree of decisions, and a random set of patterns that can be touched."""

    def split(row):
        open_signs = [k for k, sign in enumerate(row) if sign == 0]
        if not open_signs or not draw(st.booleans()):
            return [row]
        k = draw(st.sampled_from(open_signs))
        return [leaf for sign in (1, -1) for leaf in split((*row[:k], sign, *row[k + 1 :]))]

    touchable = draw(st.sets(st.sampled_from(every(functions)), min_size=1))
    return draw(st.permutations(split((0,) * functions))), sorted(touchable)


@settings(max_examples=200, deadline=None)
@given(trees())
def test_every_touchable_pattern_stays_with_the_mode_that_had_it(tree):
    stated, touchable = tree
    rows = sign_cubes(stated, touchable)
    for pattern in touchable:
        owner = [i for i, row in enumerate(stated) if inside(row, pattern)]
        assert [i for i, row in enumerate(rows) if inside(row, pattern)] == owner
    assert all(sign in (0, s) for row, of in zip(rows, stated) for sign, s in zip(row, of))


@settings(max_examples=200, deadline=None)
@given(trees(), st.data())
def test_merging_keeps_the_patterns(tree, data):
    stated, _ = tree
    chosen = data.draw(st.lists(st.sampled_from(stated), unique=True))
    fewer = merged(chosen)
    assert len(fewer) <= len(chosen)
    for pattern in every(4):
        assert sum(inside(row, pattern) for row in fewer) == sum(inside(row, pattern) for row in chosen)
