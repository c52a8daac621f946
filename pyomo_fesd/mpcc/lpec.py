"""The reduced LPEC: the MPCC linearised at a point, binaries only for bi-active pairs, solved by HiGHS (theory, eq. 17).

    min  grad f' d
    s.t. linearised rows and bounds,   |d_j| <= Delta max(1, |w_j|)
         G_i + grad G_i' d  = 0  (alpha),   H_i + grad H_i' d  = 0  (beta),   the other side >= 0
         0 <= G_i + grad G_i' d <= M_i^G y_i,   0 <= H_i + grad H_i' d <= M_i^H (1 - y_i),   y_i in {0, 1}  (gamma)

with M_i from the row's 1-norm over the trust region, never a global big-M.  d = 0 is feasible by construction: what the point
already violates is not asked of d.
"""

import time
from dataclasses import dataclass

import highspy
import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.active_set import G_ZERO, H_ZERO

#: Tighter than HiGHS' own 1e-7: a step's value is compared with 1e-6.
FEASIBILITY = 1e-9


@dataclass(frozen=True)
class LpecResult:
    """Outcome of one LPEC.

    Attributes
    ----------
    solved : bool
    value : float
        grad f' d, never positive
    d : array (n)
    zero : int array (q)
        the assignment that d follows
    binaries : int
    """

    solved: bool
    value: float
    d: np.ndarray
    zero: np.ndarray
    binaries: int


class Lpec:
    """Solves LPECs of one compiled MPCC.

    Parameters
    ----------
    options : dict
        HiGHS options, passed through
    deadline : float or None
        value of ``time.perf_counter()`` at which HiGHS is to stop
    """

    def __init__(self, compiled, options, deadline=None):
        self._c, self._options, self._deadline = compiled, options, deadline

    def solve(self, w, sets, Delta, equal=None, beyond=False):
        """Solve the LPEC at ``w`` with active sets ``sets``, trust region ``Delta`` and the decisions ``equal`` imposed.

        With ``beyond`` the artificial bounds do not count: is there descent that only they forbid?
        """
        c = self._c
        free = c.artificial & beyond
        lbx, ubx = np.where(free, -np.inf, c.lbx), np.where(free, np.inf, c.ubx)
        at = c.evaluate(w)
        grad, J_g, J_G, J_H, J_equal = c.gradients(w)
        d_low, d_high = _box(w, lbx, ubx, Delta)
        gamma = np.flatnonzero(sets.gamma)
        equal = np.zeros(J_equal.shape[0], dtype=bool) if equal is None else equal
        G, H = np.maximum(at.G, 0.0), np.maximum(at.H, 0.0)
        rows = [
            (J_g, np.minimum(c.lbg - at.g, 0.0), np.maximum(c.ubg - at.g, 0.0)),
            (J_G[sets.alpha], 0.0, 0.0),
            (J_H[sets.alpha], -H[sets.alpha], np.inf),
            (J_H[sets.beta], 0.0, 0.0),
            (J_G[sets.beta], -G[sets.beta], np.inf),
            (J_G[gamma], -G[gamma], np.inf),
            (J_H[gamma], -H[gamma], np.inf),
            (J_equal[equal], 0.0, 0.0),
        ]
        A = sparse.vstack([r[0] for r in rows])
        low = np.concatenate([np.broadcast_to(r[1], r[0].shape[0]) for r in rows])
        high = np.concatenate([np.broadcast_to(r[2], r[0].shape[0]) for r in rows])
        # G + grad G d - M y <= 0  and  H + grad H d + M y <= M
        M_G, M_H = (_big_m(J[gamma], S[gamma], d_low, d_high) for J, S in ((J_G, G), (J_H, H)))
        y = len(gamma)
        switch = sparse.bmat([[J_G[gamma], -sparse.diags(M_G)], [J_H[gamma], sparse.diags(M_H)]]) if y else None
        A = sparse.hstack([A, sparse.csr_matrix((A.shape[0], y))])
        if y:
            A = sparse.vstack([A, switch])
            low = np.concatenate([low, np.full(2 * y, -np.inf)])
            high = np.concatenate([high, -G[gamma], M_H - H[gamma]])
        start = np.concatenate([np.zeros(len(w)), (sets.zero[gamma] == H_ZERO).astype(float)])
        solution = self._highs(
            np.concatenate([grad, np.zeros(y)]),
            A.tocsc(),
            low,
            high,
            np.concatenate([d_low, np.zeros(y)]),
            np.concatenate([d_high, np.ones(y)]),
            y,
            start,
        )
        zero = sets.zero.copy()
        if solution is None:
            return LpecResult(False, 0.0, np.zeros(len(w)), zero, y)
        zero[gamma] = np.where(solution[len(w) :] > 0.5, H_ZERO, G_ZERO)
        d = solution[: len(w)]
        return LpecResult(True, min(float(grad @ d), 0.0), d, zero, y)

    def _highs(self, cost, A, low, high, lower, upper, binaries, start):
        """Solve with HiGHS; the feasible d = 0 is handed over, and no 'infeasible' is believed before presolve is off."""
        lp = highspy.HighsLp()
        lp.num_col_, lp.num_row_ = A.shape[1], A.shape[0]
        lp.col_cost_, lp.col_lower_, lp.col_upper_ = cost, lower, upper
        lp.row_lower_, lp.row_upper_ = low, high
        lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
        lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = A.indptr, A.indices, A.data
        if binaries:
            kinds = [highspy.HighsVarType.kContinuous] * (A.shape[1] - binaries)
            lp.integrality_ = kinds + [highspy.HighsVarType.kInteger] * binaries
        for presolve in ('choose', 'off'):
            highs = highspy.Highs()
            highs.setOptionValue('output_flag', False)
            for name in ('primal_feasibility_tolerance', 'dual_feasibility_tolerance', 'mip_feasibility_tolerance'):
                highs.setOptionValue(name, FEASIBILITY)
            if self._deadline is not None:
                highs.setOptionValue('time_limit', max(0.0, self._deadline - time.perf_counter()))
            for name, option in (self._options | {'presolve': presolve}).items():
                highs.setOptionValue(name, option)
            highs.passModel(lp)
            guess = highspy.HighsSolution()
            guess.col_value = list(start)
            highs.setSolution(guess)
            highs.run()
            if highs.getModelStatus() == highspy.HighsModelStatus.kOptimal:
                return np.array(highs.getSolution().col_value)
        return None


def _box(w, lbx, ubx, Delta):
    """Bounds of d: the trust region, relative for large variables, within the variables' own bounds."""
    reach = Delta * np.maximum(1.0, np.abs(w))
    return np.minimum(np.maximum(-reach, lbx - w), 0.0), np.maximum(np.minimum(reach, ubx - w), 0.0)


def _big_m(J, side, d_low, d_high):
    """The largest value that each side can take in the box."""
    positive, negative = J.maximum(0), J.minimum(0)
    return side + positive @ d_high + negative @ d_low
