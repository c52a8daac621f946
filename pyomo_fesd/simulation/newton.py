"""Newton's method for one element with a given active set: equations, and the sides that are held at zero.

Square systems are solved as they are; systems with more equations than unknowns (Gauss on a slide) in the least-squares sense, and
accepted only if every residual vanishes.

Does not apply: to singular systems; the answer is None.
"""

from math import isfinite

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
#: Iterations of a method that converges quadratically; the matrix of another element does if residuals shrink to this part.
ITERATIONS, CONTRACTION = 12, 1e-3
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
        self._factor_of_entry, self._flat = columns[self._j], self._j * m + self._i
        self._matrices, self._last = _Matrices(self._i, self._j, self._shape), None

    def solve(self, w: np.ndarray) -> np.ndarray | None:
        """Return a zero near ``w``; None if the method does not converge.

        Where factors cost more than residuals, those of the last element are tried first: its matrix is often nearly the same.
        """
        found = None if self._last is None else self._iterated(w, self._last)
        return self._iterated(w, None) if found is None else found

    def _iterated(self, w, given):
        """A zero by Newton's method, or with a ``given`` inverse as long as the residuals shrink with it as fast."""
        w, inverse, before = w.copy(), given, np.inf
        for _ in range(ITERATIONS):
            V, J = self._residuals.evaluate(w)
            residual, entries = V[self._rows], J[self._entries]
            if not isfinite(residual @ residual + entries @ entries):
                return None
            terms = np.bincount(self._i, np.abs(entries * w[self._factor_of_entry]), self._shape[0])
            error = (np.abs(residual) / (EXACT * terms + TINY)).max(initial=0.0)
            if given is not None and error > max(1.0, CONTRACTION * before):
                return None
            # the last step is of the size of round-off: the matrix of the one before is as good
            if inverse is None or (given is None and error > 1):
                inverse = self._inverse(entries)
            step = None if inverse is None else inverse(residual)
            if step is None:
                return None
            w[self._columns] -= step
            if error <= 1:
                return w
            before = error
        return None

    def _inverse(self, entries):
        """The function that multiplies by the inverse of the matrix with these ``entries``; None if it is singular."""
        m, n = self._shape
        if m < n:
            return None
        limit = DENSE if m == n else DENSE_LEAST_SQUARES
        if n <= limit:
            return self._dense(entries)
        inverse = self._sparse(entries)
        self._last = inverse if m == n else None
        return inverse

    def _dense(self, entries):
        m, n = self._shape
        M = np.zeros(m * n)
        M[self._flat] = entries
        M = M.reshape(n, m).T
        if m > n:
            return lambda residual: _dense_least_squares(M, residual)
        factors, pivots, info = lapack.dgetrf(M)
        if info or (np.abs(factors.diagonal()) < SINGULAR * np.abs(M).max(axis=0)).any():
            return None
        return lambda residual: lapack.dgetrs(factors, pivots, residual)[0]

    def _sparse(self, entries):
        M = self._matrices.of(entries)
        if M is None:
            return None
        try:
            return _least_squares(M) if M.shape[0] > M.shape[1] else splu(M).solve
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


def _dense_least_squares(M, residual):
    step, _, rank, _ = np.linalg.lstsq(M, residual, rcond=SINGULAR)
    return step if rank == M.shape[1] else None


def _least_squares(M):
    """The least-squares inverse by the augmented form of the normal equations, which is better conditioned; None if singular."""
    m, n = M.shape
    augmented = sparse.bmat([[sparse.eye(m), M], [M.T, None]], format='csc')
    factors = splu(augmented)
    # column i of the matrix is column perm_c[i] of the factors
    largest = abs(augmented).max(axis=0).toarray().ravel()[np.argsort(factors.perm_c)]
    if (np.abs(factors.U.diagonal()) < SINGULAR * largest).any():
        return None
    return lambda residual: factors.solve(np.concatenate([residual, np.zeros(n)]))[m:]
