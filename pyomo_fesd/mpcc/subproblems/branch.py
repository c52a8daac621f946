"""Branch NLP: one side of every pair fixed to zero (theory, section 4).

Its solution is exactly complementary, whatever the eps of the relaxation before.  Decided pairs (eq. 13) are imposed as equations
where their eta is positive.

Takes: a compiled MPCC and an assignment.
Leaves: an NLP built once; an assignment only changes bounds.
Does not apply: where the bounds of an assignment contradict each other; ``solve`` then returns None.
"""

from dataclasses import replace
from functools import cached_property

import casadi as ca
import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.compile import Outer, composed, csr_pattern, take
from pyomo_fesd.mpcc.subproblems.active_set import FREE
from pyomo_fesd.mpcc.subproblems.differences import Differences
from pyomo_fesd.mpcc.subproblems.impact_sides import give_interior
from pyomo_fesd.mpcc.subproblems.linear_program import Program, infeasible
from pyomo_fesd.mpcc.subproblems.newton import Newton, NewtonTolerances
from pyomo_fesd.mpcc.subproblems.side_constraints import settle, with_shares
from pyomo_fesd.mpcc.subproblems.single_rows import fix_single

#: A branch starts near its solution: not so close to the bounds that Ipopt's steps are cut short, nor pushed far from them.  One
#: that starts elsewhere is left to Ipopt's own centring.
NEAR = {'mu_strategy': 'monotone', 'mu_init': 1e-4, 'bound_push': 1e-4, 'bound_frac': 1e-4}
#: Violation of the rows, and of the complementarity of bounds: in the user's unit of the objective where that is larger than the
#: solver's, down to the last one.
FEASIBILITY, OPTIMALITY, LEAST = 1e-11, 1e-10, 1e-12
#: A side that is this far from 0 is free: far more than eq. (12) adds to its sums, and little beside values that count.
GROWN = 1e-6
#: Status of a branch that has a solution only if places of fillings are open.
UNDECIDED = 'fillings undecided'
#: A row without free variables, or one of more equations than free variables, may miss its bounds by this much.
ROW_TOLERANCE = 1e-9


class Branch:
    """All branch NLPs of one MPCC.

    Parameters
    ----------
    c : MpccFunctions
    sides : Sides
    make : callable
        makes an ``NlpSolver`` from a name, x, p, f, g and perhaps a budget and derivatives
    """

    def __init__(self, c, sides, make):
        self._c, self._sides, self._make = c, sides, make
        self._rows = [*sides.chosen, *range(2 * c.pairs, c.inner)]
        self._optimality = max(OPTIMALITY * min(1.0, c.scale.f), LEAST)
        self._newton = Newton(c, sides.chosen, NewtonTolerances(FEASIBILITY, self._optimality))

    # most branches near the end of a relaxation need no NLP solver

    @cached_property
    def _nlp(self):
        weight, z = ca.SX.sym('weight'), ca.SX.sym('z', self._c.inner)
        return composed(self._c, Outer(z, ca.SX(0, 1), weight, ca.SX(0), take(z, self._rows), weight))

    @cached_property
    def solvers(self):
        """The NLP solvers for starts near to the solution and far from it."""
        nlp = self._nlp
        exact = {'constr_viol_tol': FEASIBILITY, 'compl_inf_tol': self._optimality}
        return [self._make('branch', nlp.x, nlp.p, nlp.f, nlp.g, given, nlp.derivatives) for given in (NEAR | exact, exact)]

    @cached_property
    def _pattern(self):
        return csr_pattern(self._nlp.derivatives.jacobian)

    @cached_property
    def _differences(self):
        m = len(self._c.lbg)
        return Differences(self._c, np.array([*range(m), *(m + i for i in self._rows)], dtype=int))

    @cached_property
    def _values(self):
        # few branches have a row without free variables
        return ca.Function('rows', [self._nlp.x, self._nlp.p], [self._nlp.g])

    def solve(self, w, zero, equal=None, weight=0.0, settled=ROW_TOLERANCE, far=False, box=None, nearby=False, **more):
        """Solve the branch ``zero`` from ``w``.

        Parameters
        ----------
        zero : int array (q)
            ``G_ZERO`` or ``H_ZERO`` for each pair, first settled
        equal : bool array (decisions) or None
            decisions to impose
        weight : float
            1 to keep the penalty terms in the objective, 0 to leave them out
        settled : float
            violation of rows without free variables that is accepted
        far : bool
            whether ``w`` may be far from the solution
        box : (array, array), optional
            a trust region: bounds of w besides its own
        nearby : bool
            whether only Newton's method may solve it, from the end ``duals`` of a relaxation
        more : ``max_iter``, ``steepest`` and ``stalls`` of ``NlpSolver.solve``; ``duals``, the result of a relaxation or branch
            with the multipliers to start from

        Returns
        -------
        NlpResult, or None if the assignment contradicts the bounds, or if it is not ``nearby``
        """
        if nearby and not self._newton.applies:
            return None
        options = equal, weight, settled, far, box, nearby
        result = self._solve(w, zero, *options, **more)
        if not self._c.fillings or (result is not None and result.solved):
            return result
        return self._solve_refilled(w, zero, result, options, more)

    def _solve_refilled(self, w, zero, result, options, more):
        """Solve the branch with the sides of fillings that its places show once they satisfy the decisions.

        Where that fails, a solution with open fillings shows that the branch may have one with other sides.
        """
        pairs, (equal, *_, box, _) = np.concatenate([f.pairs for f in self._c.fillings]), options
        if np.any(zero[pairs] == FREE):
            return result
        again = self._solve(self._with_decisions(w, equal, box), zero, *options, **more)
        if again is not None and again.solved:
            return again
        without = zero.copy()
        without[pairs] = FREE
        free = self._solve(w, without, *options, **more)
        return result if free is None or not free.solved else replace(result or free, status=UNDECIDED)

    def _with_decisions(self, w, equal, box):
        """``w`` with the nearest extents of places that satisfy the decisions, and the rows that contain nothing else."""
        c, extents = self._c, np.unique(np.concatenate([f.extents for f in self._c.fillings]))
        if box is not None:
            w = np.clip(w, *box)
            extents = extents[box[0][extents] < box[1][extents]]
        at, (_, J_g, _, _, J_equal) = c.evaluate(w), c.gradients(w)
        others = np.setdiff1d(np.arange(len(w)), np.concatenate([f.extents for f in c.fillings]))
        own = (c.lbg == c.ubg) & (np.abs(J_g[:, others]).sum(axis=1).A1 == 0) & (np.abs(J_g[:, extents]).sum(axis=1).A1 > 0)
        equal = np.zeros(c.equal.numel(), dtype=bool) if equal is None else equal
        A = sparse.vstack([J_g[own][:, extents], J_equal[equal][:, extents]]).toarray()
        new = w.copy()
        new[extents] += np.linalg.lstsq(A, np.concatenate([(c.lbg - at.g)[own], -c.decided(w)[equal]]), rcond=None)[0]
        return np.clip(new, c.lbx, c.ubx)

    def _solve(self, w, zero, equal, weight, settled, far, box, nearby, duals=None, **limits):
        c = self._c
        zero, w = settle(c, self._sides, w, zero), with_shares(c.fillings, w)
        bounds = self._bounds(zero)
        if bounds is None:
            return None
        lbx, ubx = bounds
        lbg, ubg = self._row_bounds(zero, equal)
        give_interior(c, zero, lbx, ubx, lbg, ubg)
        fix_single(c, w, lbx, ubx, lbg, ubg)
        box = None if box is None else tuple(bound.copy() for bound in box)
        joined = self._differences.join(w, lbx, ubx, box)
        w, start = np.clip(w, lbx, ubx), self._start(duals)
        if start is not None and start.solved and box is None and self._newton.applies:
            found = self._newton.solve(w, lbx, ubx, lbg, ubg, start)
            if found is not None:
                return replace(found, w=self._differences.parted(found.w, joined))
        if nearby:
            return None
        if not self._drop_settled_rows(w, lbx == ubx, lbg, ubg, settled):
            return None
        self._widen_surplus_equations(lbx == ubx, lbg, ubg)
        if box is not None:
            free = lbx < ubx
            lbx, ubx = np.where(free, np.maximum(lbx, box[0]), lbx), np.where(free, np.minimum(ubx, box[1]), ubx)
        near, afar = self.solvers
        result = (afar if far else near).solve(w, [weight, *c.parameters], lbx, ubx, lbg, ubg, start, **limits)
        return replace(result, w=self._differences.parted(result.w, joined))

    def on_sides(self, w, zero):
        """Return ``w`` within the bounds of the branch ``zero``; None if these contradict each other."""
        bounds = self._bounds(settle(self._c, self._sides, w, zero))
        return None if bounds is None else np.clip(w, *bounds)

    def inside(self, w, zero):
        """``on_sides``, with every side that the branch leaves free above 0, at least by ``GROWN``, as far as bounds decide it."""
        zero = settle(self._c, self._sides, w, zero)
        bounds = self._bounds(zero)
        if bounds is None:
            return None
        (lbx, ubx), sides = bounds, self._sides
        j, bound = sides.variables(np.roll(sides.zero_rows(zero), len(zero)) & (sides.row_of < 0))
        lower, upper = j[bound == 1], j[bound == 2]
        inner = np.clip(w, lbx, ubx)
        inner[lower] = np.maximum(inner[lower], lbx[lower] + GROWN)
        inner[upper] = np.minimum(inner[upper], ubx[upper] - GROWN)
        return np.clip(inner, lbx, ubx)

    def infeasible(self, zero) -> bool:
        """Whether a linear program shows that the branch ``zero``, in which pairs may be FREE, has no point."""
        c = self._c
        if not c.linear:
            return False
        at, (_, J_g, J_G, J_H, _), w = c.evaluate(c.x0), c.gradients(c.x0), c.x0
        A, here = sparse.vstack([J_g, J_G, J_H]).tocsr(), np.concatenate([at.g, at.G, at.H])
        constant, sides = here - A @ w, np.zeros(2 * len(zero))
        high = np.concatenate([c.ubg, np.where(self._sides.zero_rows(zero), 0.0, np.inf)]) - constant
        low = np.concatenate([c.lbg, sides]) - constant
        return infeasible(Program(np.zeros(len(w)), A, low, high, c.lbx, c.ubx, np.maximum(1.0, np.abs(w))))

    def _start(self, duals):
        """Multipliers of a relaxation for the rows that a branch shares with it, zero for the others."""
        if duals is None:
            return None
        rows, shared = len(self._c.lbg) + len(self._sides.chosen), np.zeros(len(self._c.lbg) + len(self._rows))
        shared[:rows] = duals.lam_g[:rows]
        return duals.with_multipliers(duals.lam_x[: len(self._c.x0)], shared)

    def _bounds(self, zero):
        lbx, ubx = self._sides.bounds(zero, self._c.lbx, self._c.ubx)
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

    def _drop_settled_rows(self, w, fixed, lbg, ubg, most):
        """Free the rows whose variables are all fixed; returns False if one of them is violated by more than ``most``."""
        settled = (self._pattern @ (~fixed).astype(float)) == 0
        if settled.any():
            g = np.asarray(self._values(w, [0.0, *self._c.parameters]), dtype=float).ravel()[settled]
            if np.any(g < lbg[settled] - most) or np.any(g > ubg[settled] + most):
                return False
            lbg[settled], ubg[settled] = -np.inf, np.inf
        return True

    @staticmethod
    def _widen_surplus_equations(fixed, lbg, ubg):
        """Turn equations into narrow ranges if they outnumber the free variables; Ipopt refuses that many equations."""
        equations = lbg == ubg
        if np.count_nonzero(equations) > np.count_nonzero(~fixed):
            lbg[equations] -= ROW_TOLERANCE
            ubg[equations] += ROW_TOLERANCE
