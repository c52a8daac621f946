"""Which rows and pairs belong to which part, for two chains of parts written by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import sparse

from pyomo_fesd.mpcc.compile.hint_indices import PartIndices
from pyomo_fesd.mpcc.subproblems.parts import NONE, SHARED, Parts

#: Variables: 0 belongs to no part; each part has its extent, a gate, an inner and a last variable.
PARTS = [range(1, 5), range(5, 9), range(9, 13)]
#: Columns of the rows and of both sides of the pairs, and the part of each.
ROWS = [([0], NONE), ([0, 3, 4], 0), ([0, 4, 7, 8], 1), ([3, 7], SHARED), ([1, 5, 9], SHARED), ([8, 11], SHARED), ([11, 12], 2)]
PAIRS = [([6], [4, 6], 1, True), ([7], [8], 1, False), ([6], [0], 1, True), ([10], [8], SHARED, True), ([2], [4], 0, False)]


def of_hand():
    """Parts 0 and 1 follow one another; part 2 is a chain of its own."""
    parts, places = [], [(0, 0), (0, 1), (1, 0)]
    for own, before, place in zip(PARTS, (0, 4, 0), places):
        own, gate, last = np.array(own), np.array(own[1:2]), np.array(own[3:])
        parts.append(PartIndices(own[0], own, gate, own, np.array([before]), last, last, *place, True, True, True))
    columns = [row for row, _ in ROWS] + [first for first, *_ in PAIRS] + [second for _, second, *_ in PAIRS]
    J = np.zeros((len(columns), 13))
    for row, entries in zip(J, columns):
        row[entries] = 1.0
    c = SimpleNamespace(parts=parts, x0=np.zeros(13), lbg=np.zeros(len(ROWS)), pairs=len(PAIRS))
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
