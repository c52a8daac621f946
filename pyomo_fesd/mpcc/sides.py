"""The sides of all pairs, sorted by what it takes to keep one non-negative and to set it to zero.

A linear side whose least value over the variables' bounds is 0 needs no row: the bounds keep it non-negative, and it is zero
exactly when each of its variables stands at the bound that gives the least value.  So a branch fixes variables instead of adding
equations ("a sum of non-negative variables is 0"), and Ipopt never sees more equations than unknowns for
that reason.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.active_set import G_ZERO, H_ZERO

#: Agreement of a side's least value with 0.
EXACT = 1e-12


@dataclass(frozen=True)
class Sides:
    """Sides G (first q) and H (last q) of a compiled MPCC, index k = side * q + pair.

    Attributes
    ----------
    chosen : int array
        sides that need a row of their own, each once
    row_of : int array (2q)
        position of a side among these rows, -1 where bounds do
    fixings : csr (2q, n)
        bound at which a side without a row is zero: 1 the variable's lower, 2 its upper
    """

    chosen: np.ndarray
    row_of: np.ndarray
    fixings: object

    def zero_rows(self, zero):
        """Mask over the sides (2q) that an assignment sets to zero."""
        return np.concatenate([zero == G_ZERO, zero == H_ZERO])

    def same_rows(self, other):
        """Whether the same sides have rows, and the others the same bounds."""
        if not np.array_equal(self.row_of, other.row_of):
            return False
        without = np.flatnonzero(self.row_of < 0)
        return (self.fixings[without] != other.fixings[without]).nnz == 0


def sort_sides(c):
    """Sort the sides of a compiled MPCC."""
    S = ca.vertcat(c.G, c.H)
    if S.numel() == 0:
        return Sides(np.zeros(0, dtype=int), np.zeros(0, dtype=int), sparse.csr_matrix((0, len(c.x0))))
    nonlinear = np.array(ca.which_depends(S, c.x, 2, True))
    _, _, J_G, J_H, _ = c.gradients(c.x0)
    at = c.evaluate(c.x0)
    A = sparse.vstack([J_G, J_H]).tocsr()
    constant = np.concatenate([at.G, at.H]) - A @ c.x0
    direction, least = _least(A, c.lbx, c.ubx)
    fixable = ~nonlinear & (np.abs(least + constant) <= EXACT)
    row_of = np.full(S.numel(), -1)
    needed = np.flatnonzero(~fixable)
    _, first, row = np.unique(c.side_of[needed], return_index=True, return_inverse=True)
    row_of[needed] = row
    return Sides(needed[first], row_of, direction)


def _least(A, lower, upper):
    """Which bound each variable takes where A w is least (csr of 1: lower, 2: upper), and that least value."""
    bound = np.where(A.data > 0, lower[A.indices], upper[A.indices])
    product = A.data * np.where(A.data == 0, 0.0, bound)
    least = np.zeros(A.shape[0])
    np.add.at(least, np.repeat(np.arange(A.shape[0]), np.diff(A.indptr)), product)
    direction = sparse.csr_matrix((np.where(A.data > 0, 1.0, 2.0), A.indices, A.indptr), shape=A.shape)
    return direction, least
