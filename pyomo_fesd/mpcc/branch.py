"""Branch NLP: one side of every pair fixed to zero (theory, section 4).

Its solution is exactly complementary, so accuracy is limited by the discretisation and not by eps.  Decided pairs (eq. 13) are
imposed as equations where their eta is positive.

Takes: a compiled MPCC and an assignment.
Leaves: an NLP built once; an assignment only changes bounds.
Does not apply: where the bounds of an assignment contradict each other; ``solve`` then returns None.
"""

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.compiled import csr_pattern
from pyomo_fesd.mpcc.derivatives import Outer, composed

#: A branch starts near its solution, but neither so close to the bounds that Ipopt cannot turn, nor pushed far from them.
NEAR = {
    'mu_strategy': 'monotone',
    'mu_init': 1e-4,
    'bound_push': 1e-4,
    'bound_frac': 1e-4,
    'constr_viol_tol': 1e-11,
    'compl_inf_tol': 1e-10,
}
#: A row without free variables, or one of more equations than free variables, may miss its bounds by this much.
ROW_TOLERANCE = 1e-9


class Branch:
    """All branch NLPs of one MPCC.

    Parameters
    ----------
    compiled : Compiled
    sides : Sides
    make : callable
        makes an ``NlpSolver`` from a name, x, p, f, g and perhaps a budget and derivatives
    """

    def __init__(self, compiled, sides, make):
        c = compiled
        self._c, self._sides = c, sides
        weight, z = ca.SX.sym('weight'), ca.SX.sym('z', c.derivatives.z.shape[0])
        rows = ca.vertcat(z[sides.chosen.tolist()], z[2 * c.G.numel() :])
        nlp = composed(c, weight, Outer(z, ca.SX(0, 1), ca.SX(0), rows))
        self._pattern = csr_pattern(nlp.derivatives.jacobian)
        self._values = ca.Function('rows', [c.x, c.p], [nlp.g])
        self._nlp = make('branch', nlp.x, ca.vertcat(weight, c.p), nlp.f, nlp.g, NEAR, nlp.derivatives)

    def solve(self, w, zero, equal=None, weight=0.0, box=None, duals=None, max_iter=None):
        """Solve the branch ``zero`` from ``w``.

        Parameters
        ----------
        zero : int array (q)
            ``G_ZERO`` or ``H_ZERO`` for each pair
        equal : bool array (decisions) or None
            decisions to impose
        weight : float
            1 to keep the penalty terms in the objective, 0 to leave them out
        box : (array, array), optional
            a trust region: bounds of w besides its own
        duals : NlpResult, optional
            a relaxation's or branch's result whose multipliers to start from
        max_iter : int, optional

        Returns
        -------
        NlpResult, or None if the assignment contradicts the bounds
        """
        c = self._c
        bounds = self._bounds(zero)
        if bounds is None:
            return None
        lbx, ubx = bounds
        lbg, ubg = self._row_bounds(zero, equal)
        w = np.clip(w, lbx, ubx)
        if not self._drop_settled_rows(w, lbx == ubx, lbg, ubg):
            return None
        self._widen_surplus_equations(lbx == ubx, lbg, ubg)
        if box is not None:
            free = lbx < ubx
            lbx, ubx = np.where(free, np.maximum(lbx, box[0]), lbx), np.where(free, np.minimum(ubx, box[1]), ubx)
        return self._nlp.solve(w, [weight, *c.parameters], lbx, ubx, lbg, ubg, self._start(duals), max_iter)

    def _start(self, duals):
        """Multipliers of a relaxation for the rows that a branch shares with it, zero for the others."""
        if duals is None:
            return None
        rows, shared = len(self._c.lbg) + len(self._sides.chosen), np.zeros(self._pattern.shape[0])
        shared[:rows] = duals.lam_g[:rows]
        return duals.with_multipliers(duals.lam_x[: len(self._c.x0)], shared)

    def _bounds(self, zero):
        c, sides = self._c, self._sides
        by_bounds = sides.zero_rows(zero) & (sides.row_of < 0)
        fixed = sides.fixings[np.flatnonzero(by_bounds)]
        lower = np.unique(fixed.indices[fixed.data == 1])
        upper = np.unique(fixed.indices[fixed.data == 2])
        lbx, ubx = c.lbx.copy(), c.ubx.copy()
        ubx[lower] = c.lbx[lower]
        lbx[upper] = c.ubx[upper]
        return None if np.any(lbx > ubx) else (lbx, ubx)

    def _row_bounds(self, zero, equal):
        c, sides = self._c, self._sides
        own = sides.row_of >= 0
        upper = np.full(len(sides.chosen), np.inf)
        upper[sides.row_of[own & sides.zero_rows(zero)]] = 0.0
        equal = np.zeros(c.equal.numel(), dtype=bool) if equal is None else equal
        free = np.where(equal, 0.0, np.inf)
        lbg = np.concatenate([c.lbg, np.zeros(len(upper)), -free])
        return lbg, np.concatenate([c.ubg, upper, free])

    def _drop_settled_rows(self, w, fixed, lbg, ubg):
        """Free the rows whose variables are all fixed; False if one of them is violated."""
        settled = (self._pattern @ (~fixed).astype(float)) == 0
        if settled.any():
            g = np.asarray(self._values(w, self._c.parameters), dtype=float).ravel()[settled]
            if np.any(g < lbg[settled] - ROW_TOLERANCE) or np.any(g > ubg[settled] + ROW_TOLERANCE):
                return False
            lbg[settled], ubg[settled] = -np.inf, np.inf
        return True

    @staticmethod
    def _widen_surplus_equations(fixed, lbg, ubg):
        """More equations than free variables: some depend on the others.  As narrow ranges Ipopt takes them."""
        equations = lbg == ubg
        if np.count_nonzero(equations) > np.count_nonzero(~fixed):
            lbg[equations] -= ROW_TOLERANCE
            ubg[equations] += ROW_TOLERANCE
