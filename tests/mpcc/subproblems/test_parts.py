"""Which rows and pairs belong to which part, for chains of parts written by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import sparse

from pyomo_fesd.mpcc.compile.hint_indices import PartIndices
from pyomo_fesd.mpcc.subproblems.parts import NONE, SHARED, Parts

#: Variables: 0 belongs to no part; each part has its extent, a gate, an inner and a last variable.
PARTS = [range(1, 5), range(5, 9), range(9, 13)]
#: Columns of the rows and of both sides of the pairs, and the part of each.
ROWS = [([0], NONE), ([0, 3, 4], 0), ([0, 4, 7, 8], 1), ([1, 3, 7], SHARED), ([1, 5, 9], SHARED), ([8, 11], SHARED), ([11, 12], 2)]
PAIRS = [([6], [4, 6], 1, True), ([7], [8], 1, False), ([6], [0], 1, True), ([10], [8], SHARED, True), ([2], [4], 0, False)]


def of_hand(rows=ROWS, places=((0, 0), (0, 1), (1, 0))):
    """Parts at these places: the number of a chain, and that in the chain."""
    parts = []
    for own, (chain, number) in zip(PARTS, places):
        own, gate, last = np.array(own), np.array(own[1:2]), np.array(own[3:])
        before = np.array([own[0] - 1 if number else 0])
        parts.append(PartIndices(own[0], own, gate, own.copy(), before, last, last, chain, number, True, True, True))
    columns = [row for row, _ in rows] + [first for first, *_ in PAIRS] + [second for _, second, *_ in PAIRS]
    J = np.zeros((len(columns), 13))
    for row, entries in zip(J, columns):
        row[entries] = 1.0
    c = SimpleNamespace(parts=parts, x0=np.zeros(13), lbg=np.zeros(len(rows)), pairs=len(PAIRS))
    c.stacked_jacobian = lambda w: sparse.csr_matrix(J)
    return Parts(c)


def test_a_row_belongs_to_the_part_whose_variables_it_has_beside_the_last_ones_before():
    parts = of_hand()
    assert parts.of_row[: len(ROWS)].tolist() == [of for _, of in ROWS]


def test_both_sides_of_a_pair_belong_to_one_part():
    parts, m, q = of_hand(), len(ROWS), len(PAIRS)
    assert parts.of_pair.tolist() == [of for *_, of, _ in PAIRS]
    assert parts.of_row[m : m + q].tolist() == parts.of_row[m + q : m + 2 * q].tolist()


@pytest.mark.parametrize('pair', range(len(PAIRS)))
def test_a_pair_of_a_gate_has_no_inner_and_no_last_variable_of_its_part(pair):
    assert of_hand().in_gate[pair] == PAIRS[pair][-1]


def test_parts_of_one_chain_follow_one_another():
    parts = of_hand()
    assert [parts.next(k) for k in range(3)] == [1, None, None]
    assert [parts.previous(k) for k in range(3)] == [None, 0, None]
    assert [parts.beside(k) for k in range(3)] == [(1,), (0,), ()]


def test_the_motion_of_parts_is_their_extents_and_last_values():
    assert of_hand().motion.tolist() == [1, 4, 5, 8, 9, 12]


def test_without_parts_all_variables_are_the_motion():
    assert Parts(SimpleNamespace(parts=[], x0=np.zeros(3))).motion.tolist() == [0, 1, 2]


# What a part hands on: its inner variable, which rows of the next part contain

ONE_CHAIN = (0, 0), (0, 1), (0, 2)


def test_what_rows_of_every_next_part_contain_is_handed_on():
    parts = of_hand([([3, 7], 1), ([7, 8, 11], 2)], ONE_CHAIN)
    assert parts.of_row[:2].tolist() == [1, 2] and np.flatnonzero(parts.is_handed_on).tolist() == [3, 7, 11]
    assert [part.tolist() for part in parts.entry(1)] == [[4, 3], [8, 7]]
    assert [parts.is_whole(k) for k in range(3)] == [False, True, True] and parts.hands_on(0)


def test_what_rows_of_one_part_alone_contain_is_not():
    parts = of_hand([([3, 7], SHARED), ([8, 11], 2)], ONE_CHAIN)
    assert parts.of_row[:2].tolist() == [SHARED, 2] and not parts.is_handed_on.any()
    assert [part.tolist() for part in parts.entry(1)] == [[4], [8]] and parts.is_whole(0) and not parts.hands_on(0)


def test_what_is_given_in_the_part_before_is_not_followed():
    parts = of_hand([([7], 1), ([7, 11], 2)], ONE_CHAIN)
    parts.all[0].places[2] = NONE
    assert parts.of_row[:2].tolist() == [1, 2] and [part.tolist() for part in parts.entry(2)] == [[8, 7], [12, 11]]
    assert [parts.is_whole(k) for k in range(3)] == [False, False, True]


# Parts of nearly no extent


@pytest.mark.parametrize('short', [0, 1, 2])
def test_a_place_touches_a_short_part_where_one_of_its_two_neighbours_is(short):
    parts, w = of_hand(places=ONE_CHAIN), np.ones(13)
    w[PARTS[short][0]] = 1e-6
    assert [parts.touches_a_short_one(w, k, ahead=False) for k in range(3)] == [short in (k, k + 1) for k in range(3)]
    assert [parts.touches_a_short_one(w, k, ahead=True) for k in range(3)] == [short in (k - 1, k) for k in range(3)]
    assert [parts.is_beside_a_short_one(w, k) for k in range(3)] == [abs(short - k) <= 1 for k in range(3)]
