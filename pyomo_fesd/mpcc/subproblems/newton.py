"""Newton's method in a branch, from the end of a relaxation: near the solution an NLP solver takes far longer to set up.

A bound is active where its multiplier is larger than the distance from it (primal-dual active sets).  With the active rows A each
step solves

    [H + d I   A' ] [step]   [-gradient          ]
    [A       -d I ] [y   ] = [-residual - d y_old]

The shift d keeps rows that depend on each other, the rule in a branch, from making the matrix singular; it changes no solution.

Source: Hintermueller, Ito, Kunisch, SIAM J. Optim. 13 (2002) 865.

Takes: bounds and start of a branch NLP, with the multipliers of a relaxation.
Leaves: its solution.
Does not apply: with decisions or penalties, and where it leaves the start or does not converge; ``solve`` then returns None.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from pyomo_fesd.mpcc.compile import major_index
from pyomo_fesd.mpcc.nlp import NEWTON, NlpResult

#: Steps before an NLP solver takes over, and how far each may lead, relative to the sizes of the variables.
STEPS, FARTHEST = 6, 0.3
#: The shift d.
SHIFT = 1e-8


@dataclass(frozen=True)
class Tolerances:
    """Largest violation of rows and bounds, and of stationarity and complementarity of their multipliers."""

    violation: float
    optimality: float


@dataclass(frozen=True)
class _Limits:
    """Bounds of values."""

    low: np.ndarray
    high: np.ndarray

    def active(self, values, multipliers):
        """The values that a bound holds, and how far it is."""
        to_low, to_high = self.low - values, self.high - values
        at_high = (self.low < self.high) & (multipliers > to_high)
        active = (self.low == self.high) | at_high | (multipliers < to_low)
        return active, np.where(at_high, to_high, np.where(active, to_low, 0.0))

    def violation(self, values):
        """The largest one."""
        return np.maximum(self.low - values, values - self.high).max(initial=0.0)

    def slackness(self, values, multipliers):
        """The largest multiplier of a bound that does not hold its value, or distance from one with a multiplier."""
        distance = np.where(multipliers > 0.0, self.high - values, values - self.low)
        return np.minimum(np.abs(multipliers), np.abs(distance)).max(initial=0.0)


class Newton:
    """Newton's method for the branches of one MPCC.

    Parameters
    ----------
    c : MpccFunctions
    sides : int array
        sides with a row; the rows of a branch are g and these
    tolerances : Tolerances
    """

    def __init__(self, c, sides, tolerances):
        self._c, self._sides, self._tolerances = c, sides, tolerances
        self._rows = np.concatenate([np.arange(len(c.lbg)), len(c.lbg) + sides])

    @property
    def applies(self) -> bool:
        """Whether the MPCC has neither decisions nor penalties."""
        return not self._c.equal.numel() and not self._c.has_penalty

    def solve(self, w, lbx, ubx, lbg, ubg, duals) -> NlpResult | None:
        """The solution near ``w`` with the multipliers ``duals``, or None."""
        of_x, of_rows, y, z = _Limits(lbx, ubx), _Limits(lbg, ubg), duals.lam_g, duals.lam_x
        for count in range(1, STEPS + 1):
            step, y = self._step(w, of_x, of_rows, y, z)
            if not np.abs(step / np.maximum(1.0, np.abs(w))).max(initial=0.0) <= FARTHEST:
                return None
            w = w + step
            gradient, J, rows = self._linearised(w)
            reduced = gradient + J.T @ y
            held, _ = of_x.active(w, -reduced)
            z = np.where(held, -reduced, 0.0)
            optimality = max(np.abs(reduced + z).max(initial=0.0), of_x.slackness(w, z), of_rows.slackness(rows, y))
            violation = max(of_x.violation(w), of_rows.violation(rows))
            if violation <= self._tolerances.violation and optimality <= self._tolerances.optimality:
                w = np.clip(w, lbx, ubx)
                return NlpResult(w, self._c.evaluate(w).f, NEWTON, count, y, z)
        return None

    def _linearised(self, w):
        """Gradient of f, Jacobian and values of the rows."""
        at = self._c.evaluate(w)
        rows = np.concatenate([at.g, np.concatenate([at.G, at.H])[self._sides]])
        return self._c.gradients(w)[0], self._c.stacked_jacobian(w)[self._rows], rows

    def _step(self, w, of_x, of_rows, y, z):
        """A step and the multipliers of the rows at its end; numbers that are not finite where there is none."""
        gradient, J, rows = self._linearised(w)
        held, step = of_x.active(w, z)
        active, distance = of_rows.active(rows, y)
        H, A, free = self._hessian(w, y), J[np.flatnonzero(active)], np.flatnonzero(~held)
        residual = distance[active] - A @ step
        right = np.concatenate([-(gradient + H @ step)[free], residual - SHIFT * y[active]])
        new = _solved(_shifted(H[free][:, free], A[:, free]), right)
        step[free], y = new[: len(free)], np.zeros(len(y))
        y[active] = new[len(free) :]
        return step, y

    def _hessian(self, w, y):
        """The Hessian of the Lagrangian (csr)."""
        of_sides, m = np.zeros(2 * self._c.pairs), len(self._c.lbg)
        of_sides[self._sides] = y[m:]
        return self._c.hessian(w, y[:m], of_sides)


def _shifted(H, A):
    """The matrix of a step."""
    n, m = H.shape[0], A.shape[0]
    shift, own, of_rows = np.repeat([SHIFT, -SHIFT], [n, m]), np.arange(n + m), n + major_index(A)
    rows = np.concatenate([own, major_index(H), of_rows, A.indices])
    columns = np.concatenate([own, H.indices, A.indices, of_rows])
    return sparse.csc_matrix((np.concatenate([shift, H.data, A.data, A.data]), (rows, columns)), shape=(n + m, n + m))


def _solved(matrix, right):
    if not (matrix.shape[0] and np.isfinite(matrix.data).all()):
        return np.full(len(right), np.nan)
    try:
        return splu(matrix, permc_spec='MMD_AT_PLUS_A').solve(right)
    except RuntimeError:  # singular
        return np.full(len(right), np.nan)
