"""Columns of copies in a row: each copy begins with the last values of the one before it."""

import pytest
from problems import inserted

from pyomo_fesd.mpcc.subproblems.copy_columns import columns_of_row
from pyomo_fesd.mpcc.subproblems.inserted_copy import Insertion


@pytest.fixture(scope='module')
def short():
    return inserted.compiled(4, 'heaviside')


def row(short, *copies):
    """The columns of copies, each a part and whether it lies ahead of it."""
    return columns_of_row(short.parts, [Insertion(k, ahead, None, None, ()) for k, ahead in copies], len(short.w))


def last_of(short, copy):
    """The columns of the last values of a copy, in the order of its part."""
    own = list(copy.own)
    first = copy.place_of_extent - own.index(copy.extent)
    return [first + own.index(j) for j in short.parts.all[copy.k].last]


@pytest.mark.parametrize('copies', [[(2, True), (2, True)], [(1, False), (1, False)], [(1, False), (2, True)]], ids=str)
def test_a_copy_begins_where_the_one_before_it_ends(short, copies):
    before, after = row(short, *copies)
    begins = [after.columns[j] for j in short.parts.all[after.k].first]
    assert begins == last_of(short, before)
    assert list(after.passed_on.values()) == last_of(short, after)


def test_the_first_copy_begins_at_the_boundary_of_the_model(short):
    parts = short.parts.all
    (ahead,), (behind,) = row(short, (2, True)), row(short, (1, False))
    assert [ahead.columns[j] for j in parts[2].first] == list(parts[2].first)
    assert [behind.columns[j] for j in parts[1].first] == list(parts[1].last)


def test_the_last_copy_behind_a_part_takes_over_its_end(short):
    assert [bool(copy.ends) for copy in row(short, (1, False), (1, False), (2, True))] == [False, True, False]


def test_variables_of_no_copy_are_those_of_the_model(short):
    parts = short.parts.all
    (copy,) = row(short, (1, False))
    theta = short.names.index('theta')
    assert copy.of_model([*parts[1].own, *parts[1].first, theta]) == [*parts[1].last, theta]
