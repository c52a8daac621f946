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

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from pyomo_fesd.mpcc.compile import major_index
from pyomo_fesd.mpcc.nlp import NEWTON, NlpResult

#: Steps before an NLP solver takes over, and how far each may lead, relative to the sizes of the variables.
STEPS, FARTHEST = 8, 0.1
#: The shift d.
SHIFT = 1e-8


@dataclass(frozen=True)
class NewtonTolerances:
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
    tolerances : NewtonTolerances
    """

    def __init__(self, c, sides, tolerances):
        self._c, self._tolerances = c, tolerances
        self._rows = np.concatenate([np.arange(len(c.lbg)), len(c.lbg) + sides])

    @property
    def applies(self) -> bool:
        """Whether the MPCC has neither decisions nor penalties."""
        return not self._c.equal.numel() and not self._c.has_penalty

    def solve(self, w, lbx, ubx, lbg, ubg, duals) -> NlpResult | None:
        """The solution near ``w`` with the multipliers ``duals``, or None."""
        of_x, of_rows = _Limits(lbx, ubx), _Limits(self._of_all(lbg, -np.inf), self._of_all(ubg, np.inf))
        y, z, left = self._of_all(duals.lam_g, 0.0), duals.lam_x, np.inf
        for count in range(1, STEPS + 1):
            step, y = self._step(w, of_x, of_rows, y, z)
            if not np.abs(step / np.maximum(1.0, np.abs(w))).max(initial=0.0) <= FARTHEST:
                return None
            w = w + step
            gradient, J, rows = self._linearised(w)
            reduced = gradient + J.T @ y
            z = np.where(of_x.active(w, -reduced)[0], -reduced, 0.0)
            optimality = max(np.abs(reduced + z).max(initial=0.0), of_x.slackness(w, z), of_rows.slackness(rows, y))
            violation = max(of_x.violation(w), of_rows.violation(rows))
            if violation <= self._tolerances.violation and optimality <= self._tolerances.optimality:
                w = np.clip(w, lbx, ubx)
                return NlpResult(w, self._c.evaluate(w).f, NEWTON, count, y[self._rows], z)
            if not max(optimality, violation) < left:
                return None
            left = max(optimality, violation)
        return None

    def _of_all(self, numbers, other):
        """Numbers of the branch's rows as those of g, G and H, with ``other`` for sides without a row."""
        found = np.full(len(self._c.lbg) + 2 * self._c.pairs, other)
        found[self._rows] = numbers
        return found

    def _linearised(self, w):
        """Gradient of f, Jacobian and values of g, G and H."""
        at = self._c.evaluate(w)
        return self._c.gradients(w)[0], self._c.stacked_jacobian(w), np.concatenate([at.g, at.G, at.H])

    def _step(self, w, of_x, of_rows, y, z):
        """A step and the multipliers of the rows at its end; numbers that are not finite where there is none."""
        (gradient, J, rows), H = self._linearised(w), self._c.hessian(w, np.append(0.0, y))
        held, step = of_x.active(w, z)
        active, distance = of_rows.active(rows, y)
        free = ~held
        right = np.concatenate([-(gradient + H @ step)[free], (distance - J @ step - SHIFT * y)[active]])
        new = _solved(_matrix(H, J, free, active), right)
        step[free], y = new[: np.count_nonzero(free)], np.zeros(len(y))
        y[active] = new[np.count_nonzero(free) :]
        return step, y


def _matrix(H, J, free, active):
    """The matrix of a step, of the ``free`` variables and the ``active`` rows."""
    n, m = np.count_nonzero(free), np.count_nonzero(active)
    of_x, of_rows, own = _positions(free, 0), _positions(active, n), np.arange(n + m)
    H_row, J_row, H_column, J_column = of_x[major_index(H)], of_rows[major_index(J)], of_x[H.indices], of_x[J.indices]
    rows = np.concatenate([H_row, J_row, J_column, own])
    columns = np.concatenate([H_column, J_column, J_row, own])
    entries = np.concatenate([H.data, J.data, J.data, np.repeat([SHIFT, -SHIFT], [n, m])])
    inside = (rows >= 0) & (columns >= 0)
    return sparse.csc_matrix((entries[inside], (rows[inside], columns[inside])), shape=(n + m, n + m))


def _positions(chosen, first):
    """Positions of the chosen ones, from ``first`` on; -1 for the others."""
    return np.where(chosen, np.cumsum(chosen) - 1 + first, -1)


def _solved(matrix, right):
    """The solution of linear equations; numbers that are not finite where the matrix is singular or not finite."""
    if np.isfinite(matrix.data).all():
        with suppress(RuntimeError):
            return splu(matrix).solve(right)
    return np.full(len(right), np.nan)
