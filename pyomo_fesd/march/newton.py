"""Newton's method for one element whose active set is known: equations, and the sides that are held at zero.

Square systems are solved as they are; where more is known than needed (Gauss on a slide) in the least-squares sense, and accepted
only if every residual vanishes.

Takes: ``Functions``, which rows of V are to vanish, which columns are free.
Leaves: nothing.
Does not apply: to singular systems; they have no answer.
"""

import numpy as np
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.linalg import splu

#: Up to this number of unknowns a dense factorisation is faster.
DENSE = 150
#: Residuals in relation to the terms that they are the sum of, and in the solver's scale.
EXACT, TINY = 1e-12, 1e-14
#: Iterations of a method that converges quadratically.
ITERATIONS = 12
#: A pivot below this part of its column is none.
SINGULAR = 1e-13


class System:
    """Which equations hold, for which unknowns.

    Parameters
    ----------
    functions : Functions
    vanishing : int array
        rows of V
    columns : int array
        of w
    event : (int array, array), optional
        rows of V and their weights, whose sum is to vanish too
    """

    def __init__(self, functions, vanishing, columns, event=None):
        self._functions, self._vanishing, self._columns, self._event = functions, vanishing, columns, event
        self.shape = m, n = len(vanishing) + (event is not None), len(columns)
        row, column = np.full(functions.V.size, -1), np.full(functions.lower.size, -1)
        row[vanishing], column[columns] = np.arange(len(vanishing)), np.arange(n)
        i, j, weights = row[functions.rows], column[functions.columns], np.ones(functions.rows.size)
        source = np.arange(functions.rows.size)
        if event is not None:
            factor = np.zeros(functions.V.size)
            factor[event[0]] = event[1]
            last = factor[functions.rows]
            i, j = np.concatenate([i, np.where(last != 0, m - 1, -1)]), np.concatenate([j, j])
            weights, source = np.concatenate([weights, last]), np.concatenate([source, source])
        kept = (i >= 0) & (j >= 0)
        self._i, self._j, self._weights, self._source = i[kept], j[kept], weights[kept], source[kept]
        self._flat = self._i * n + self._j

    def solve(self, w):
        """A zero near ``w``; None if there is none."""
        w, columns = w.copy(), self._columns
        for _ in range(ITERATIONS):
            V, J = self._functions.at(w)
            residual = V[self._vanishing]
            if self._event is not None:
                residual = np.append(residual, V[self._event[0]] @ self._event[1])
            entries = J[self._source] * self._weights
            if not (np.isfinite(residual).all() and np.isfinite(entries).all()):
                return None
            terms = np.bincount(self._i, np.abs(entries * w[columns][self._j]), self.shape[0])
            step = self._step(entries, residual)
            if step is None:
                return None
            w[columns] -= step
            if (np.abs(residual) <= EXACT * terms + TINY).all():
                return w
        return None

    def _step(self, entries, residual):
        m, n = self.shape
        if m < n:
            return None
        return self._dense(entries, residual) if n <= DENSE else self._sparse(entries, residual)

    def _dense(self, entries, residual):
        m, n = self.shape
        M = np.bincount(self._flat, entries, m * n).reshape(m, n)
        if m > n:
            step, _, rank, _ = np.linalg.lstsq(M, residual, rcond=SINGULAR)
            return step if rank == n else None
        factors, pivots, info = lapack.dgetrf(M)
        if info or (np.abs(np.diagonal(factors)) < SINGULAR * np.abs(M).max(axis=0)).any():
            return None
        return lapack.dgetrs(factors, pivots, residual)[0]

    def _sparse(self, entries, residual):
        m, n = self.shape
        M = sparse.csc_matrix((entries, (self._i, self._j)), shape=(m, n))
        try:
            if m > n:
                # the normal equations in their stable form
                whole = sparse.bmat([[sparse.eye(m), M], [M.T, None]], format='csc')
                return splu(whole).solve(np.concatenate([residual, np.zeros(n)]))[m:]
            return splu(M).solve(residual)
        except RuntimeError:
            return None
