"""casadi's Jacobians as one scipy matrix and its parts."""

import casadi as ca
import numpy as np
import pytest

from pyomo_fesd.mpcc.compile.stacked_jacobian import StackedJacobian


def blocks():
    """Two Jacobians of three variables at a point: four rows, one of them without entries, and one row."""
    x = ca.SX.sym('x', 3)
    rows = ca.vertcat(x[2] * x[0], x[1], 7.0, x[0] + x[1] * x[2]), ca.sin(x[1]) + x[0]
    return [ca.evalf(ca.substitute(ca.jacobian(g, x), x, ca.SX([2.0, 3.0, 5.0]))) for g in rows]


@pytest.mark.parametrize('heights', [(4, 1), (1, 2, 2), (0, 3, 0, 2), (5, 0)])
def test_the_stack_and_its_parts(heights):
    J = blocks()
    pattern = StackedJacobian([block.sparsity() for block in J], heights)
    numbers = np.concatenate([np.array(block.nonzeros()) for block in J])
    stacked, *parts = pattern.at(numbers)
    wanted = np.vstack([block.full() for block in J])
    np.testing.assert_array_equal(stacked.toarray(), wanted)
    assert stacked.has_sorted_indices
    ends = np.cumsum((0, *heights))
    for part, first, end in zip(parts, ends, ends[1:]):
        np.testing.assert_array_equal(part.toarray(), wanted[first:end])
    assert pattern.nonzeros == [part.nnz for part in parts]


def test_two_points_do_not_share_their_numbers():
    J = blocks()
    pattern = StackedJacobian([block.sparsity() for block in J], [5])
    numbers = np.concatenate([np.array(block.nonzeros()) for block in J])
    first, _ = pattern.at(numbers)
    second, _ = pattern.at(2 * numbers)
    np.testing.assert_array_equal(2 * first.toarray(), second.toarray())


def test_without_rows():
    stacked, part = StackedJacobian([ca.Sparsity(0, 3)], [0]).at(np.zeros(0))
    assert stacked.shape == part.shape == (0, 3)
