"""Newton's method for one element with a given active set: equations, and the sides that are held at zero.

Square systems are solved as they are; systems with more equations than unknowns (Gauss on a slide) in the least-squares sense, and
accepted only if every residual vanishes.

Does not apply: to singular systems; the answer is None.
"""

import numpy as np
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.csgraph import structural_rank
from scipy.sparse.linalg import splu

from pyomo_fesd.simulation.element_residuals import ElementResiduals

#: Up to these numbers of unknowns a dense method is taken, for square systems and least squares: faster, and safer for the latter,
#: which may have dependent columns.  Above them OpenBLAS uses threads, which wait for one another where the machine is busy.
DENSE, DENSE_LEAST_SQUARES = 120, 150
#: Largest residuals of a solution: relative to the terms of their sum, and in the solver's scale.
EXACT, TINY = 1e-12, 1e-14
#: Iterations of a method that converges quadratically.
ITERATIONS = 12
#: A matrix with a pivot below this part of its column is singular.
SINGULAR = 1e-13


class NewtonSystem:
    """The system of equations V[rows] = 0 in the entries ``columns`` of w."""

    def __init__(self, residuals: ElementResiduals, rows: np.ndarray, columns: np.ndarray):
        self._residuals, self._rows, self._columns = residuals, rows, columns
        self._shape = m, n = len(rows), len(columns)
        row, column = np.full(residuals.V.size, -1), np.full(residuals.lower.size, -1)
        row[rows], column[columns] = np.arange(m), np.arange(n)
        i, j = row[residuals.rows], column[residuals.columns]
        self._entries = np.flatnonzero((i >= 0) & (j >= 0))
        self._i, self._j = i[self._entries], j[self._entries]
        self._flat, self._matrices = self._i * n + self._j, _Matrices(self._i, self._j, self._shape)

    def solve(self, w: np.ndarray) -> np.ndarray | None:
        """Return a zero near ``w``; None if the method does not converge."""
        w, columns = w.copy(), self._columns
        for _ in range(ITERATIONS):
            V, J = self._residuals.evaluate(w)
            residual, entries = V[self._rows], J[self._entries]
            if not (np.isfinite(residual).all() and np.isfinite(entries).all()):
                return None
            terms = np.bincount(self._i, np.abs(entries * w[columns][self._j]), self._shape[0])
            step = self._step(entries, residual)
            if step is None:
                return None
            w[columns] -= step
            if (np.abs(residual) <= EXACT * terms + TINY).all():
                return w
        return None

    def _step(self, entries, residual):
        m, n = self._shape
        if m < n:
            return None
        limit = DENSE if m == n else DENSE_LEAST_SQUARES
        return self._dense(entries, residual) if n <= limit else self._sparse(entries, residual)

    def _dense(self, entries, residual):
        m, n = self._shape
        M = np.bincount(self._flat, entries, m * n).reshape(m, n)
        if m > n:
            step, _, rank, _ = np.linalg.lstsq(M, residual, rcond=SINGULAR)
            return step if rank == n else None
        factors, pivots, info = lapack.dgetrf(M)
        if info or (np.abs(np.diagonal(factors)) < SINGULAR * np.abs(M).max(axis=0)).any():
            return None
        return lapack.dgetrs(factors, pivots, residual)[0]

    def _sparse(self, entries, residual):
        M = self._matrices.of(entries)
        if M is None:
            return None
        try:
            return _least_squares(M, residual) if M.shape[0] > M.shape[1] else splu(M).solve(residual)
        except RuntimeError:
            return None


class _Matrices:
    """Sparse matrices with entries at the places ``i`` and ``j``: what does not depend on their values is found once."""

    def __init__(self, i: np.ndarray, j: np.ndarray, shape: tuple[int, int]):
        self._order = np.lexsort((i, j))
        self._i, self._j, self._shape = i[self._order], j[self._order], shape
        self._present, self._matrix = None, None

    def of(self, entries: np.ndarray) -> sparse.csc_matrix | None:
        """Return the matrix, without zeros and valid until the next call; None if its columns are dependent by their places."""
        entries = entries[self._order]
        present = entries != 0
        if not np.array_equal(present, self._present):
            self._present, self._matrix = present, self._with_places(present)
        if self._matrix is not None:
            self._matrix.data = entries[present]
        return self._matrix

    def _with_places(self, present):
        """A matrix with entries at some of the places; None where SuperLU may write beyond its memory."""
        ends = np.searchsorted(self._j[present], np.arange(self._shape[1] + 1))
        M = sparse.csc_matrix((np.ones(ends[-1]), self._i[present], ends), shape=self._shape)
        return None if structural_rank(M) < self._shape[1] else M


def _least_squares(M, residual):
    """The least-squares solution by the augmented form of the normal equations, which is better conditioned; None if singular."""
    m, n = M.shape
    augmented = sparse.bmat([[sparse.eye(m), M], [M.T, None]], format='csc')
    factors = splu(augmented)
    # column i of the matrix is column perm_c[i] of the factors
    largest = abs(augmented).max(axis=0).toarray().ravel()[np.argsort(factors.perm_c)]
    if (np.abs(factors.U.diagonal()) < SINGULAR * largest).any():
        return None
    return factors.solve(np.concatenate([residual, np.zeros(n)]))[m:]
