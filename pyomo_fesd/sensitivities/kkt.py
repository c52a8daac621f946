"""The linear system of a branch's first-order conditions, solved so that it shows whether its answer exists and is unique.

    K = [H A'; A 0],      K (dw, dlam) = b

The equations of moving elements are partly redundant, and lengths of elements may be free, so K is singular at many solutions whose
derivatives exist all the same.  Proximal iterations with K + delta diag(I, -I) converge exactly where b lies in the range of K.
A quantity o' dw is the same for all solutions exactly where (o, 0) lies in the range of K, as K is symmetric.  So the residual of
the forward system shows whether a derivative exists, that of the adjoint system whether it is unique.

Source: Friedlander, Orban, Math. Prog. Comp. 4 (2012) 71 (proximal regularisation).
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

#: Proximal parameter, in a system whose rows have entries up to 1; and iterations.
DELTA, ITERATIONS = 1e-8, 20
#: Relative residual at which the iterations end, and at which a right-hand side counts as one in the range.
EXACT, IN_RANGE = 1e-13, 1e-7


@dataclass(frozen=True)
class Answer:
    """Solutions of K for several right-hand sides: ``x`` (n, k) and ``y`` (m, k), and what is left of each one.

    Attributes
    ----------
    left : (array (n, k), array (m, k)), residuals
    exists : bool array (k), whether the right-hand side lies in the range of K
    """

    x: np.ndarray
    y: np.ndarray
    left: tuple
    exists: np.ndarray


class Kkt:
    """K, factorised.

    Parameters
    ----------
    H : csr (n, n), symmetric
    A : csr (m, n)
    """

    def __init__(self, H, A):
        self._n = H.shape[0]
        largest = largest_entries(A)
        self._cost, self._rows = 1.0 / max(1.0, largest_entries(H).max(initial=0.0)), 1.0 / np.where(largest > 0, largest, 1.0)
        A = sparse.diags(self._rows) @ A
        self._K = sparse.bmat([[H * self._cost, A.T], [A, None]]).tocsc() if A.shape[0] else sparse.csc_matrix(H * self._cost)
        signs = np.concatenate([np.ones(self._n), -np.ones(A.shape[0])])
        self._factors = splu((self._K + DELTA * sparse.diags(signs)).tocsc())

    def solve(self, b, d) -> Answer:
        """Solve for right-hand sides ``b`` (n, k) of stationarity and ``d`` (m, k) of the rows."""
        right = np.vstack([b * self._cost, d * self._rows[:, None]])
        sizes = np.abs(right).max(axis=0, initial=0.0)
        found, left = np.zeros_like(right), right
        for _ in range(ITERATIONS):
            found = found + self._factors.solve(left)
            left = right - self._K @ found
            if np.all(np.abs(left).max(axis=0, initial=0.0) <= EXACT * sizes):
                break
        exists = np.isfinite(found).all(axis=0) & (np.abs(left).max(axis=0, initial=0.0) <= IN_RANGE * sizes)
        n, rows = self._n, self._rows[:, None]
        return Answer(found[:n], found[n:] * rows / self._cost, (left[:n], left[n:]), exists)


def largest_entries(A):
    """The largest absolute entry of each row."""
    return np.abs(A).max(axis=1).toarray().ravel() if 0 not in A.shape else np.zeros(A.shape[0])
