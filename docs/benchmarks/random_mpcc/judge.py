"""Judge what a solver says of an ``Instance``, without any code of pyomo_fesd.

A certificate is checked by an LP (scipy) for every assignment of the pairs that are bi-active at the point, with casadi's exact
derivatives, and by Ipopt within a small box around the point in every branch nearby.  'Infeasible' and 'unbounded' are checked
against all branches, or a ray.
"""

import itertools

import casadi as ca
import numpy as np
from scipy.optimize import linprog

#: Violation of a claimed point, rows relative to the larger of 1 and the largest entry of their gradient.
FEASIBLE = 1e-6
#: Sides below this are zero.
ACTIVE = 1e-6
#: Descent of an LP, in units where the objective is of order one.
DESCENT = 1e-5
#: Ipopt looks in a box of this size for points that are lower by this; less may be second order.
NEAR, LOWER = 1e-2, 1e-3
#: A point this far away with an objective this low shows that f falls for ever.
FAR, DEEP = 1e8, -1e6
#: Branches to try at most.
BRANCHES = 64
RIGHT, REFUSED, FALSE, WRONG = 'right', 'refused', 'false certificate', 'wrong'
CERTIFIED = "B-stationary point found and certified"
INFEASIBLE = "no feasible point found: the problem is locally infeasible"
UNBOUNDED = "the objective falls without bound along feasible points"


class Judge:
    """Judges claims about one instance, in its good units."""

    def __init__(self, instance):
        self._p = p = instance
        w, f, g, G, H = p.symbolic()
        self._f = ca.Function('f', [w], [f, ca.gradient(f, w)])
        rows = ca.vertcat(g, G, H)
        self._rows = ca.Function('rows', [w], [rows, ca.densify(ca.jacobian(rows, w))])
        self._m, self._q = g.numel(), G.numel()
        quiet = {
            'print_time': False,
            'ipopt': {'print_level': 0, 'sb': 'yes', 'tol': 1e-10, 'bound_relax_factor': 0.0, 'max_iter': 500},
        }
        self._nlp = ca.nlpsol('branch', 'ipopt', {'x': w, 'f': f, 'g': rows}, quiet)
        restore = {'x': w, 'f': ca.SX(0), 'g': rows}
        self._feasible = ca.nlpsol('feasible', 'ipopt', restore, quiet)

    # what is said

    def verdict(self, outcome, w):
        """(verdict, reason) of an outcome (a sentence of the solver) at ``w``."""
        if outcome == CERTIFIED:
            reason = self.misses(w)
            if reason:
                return WRONG, reason
            reason = self.linear_descent(w) or self.descent(w)
            return (FALSE, reason) if reason else (RIGHT, '')
        if outcome == INFEASIBLE:
            found = self.feasible_branch()
            return (WRONG, f'branch {found} is feasible') if found else (RIGHT, '')
        if outcome == UNBOUNDED:
            return (RIGHT, '') if self._p.ray is not None or self.falls(w) else (WRONG, 'no ray is known')
        return REFUSED, outcome

    # how it is checked

    def misses(self, w):
        """What ``w`` violates, or ''."""
        if not np.isfinite(w).all():
            return 'values are missing'
        g, G, H, J = self._at(w)
        p, size = self._p, np.maximum(1.0, np.abs(J).max(axis=1, initial=0.0))
        rows = np.maximum(p.low - g, g - p.high) / size[: self._m]
        bounds = np.maximum(p.lb - w, w - p.ub) / np.maximum(1.0, np.abs(w))
        pairs = np.abs(np.minimum(G, H)) / np.minimum(size[self._m : self._m + self._q], size[self._m + self._q :])
        worst = {'row': rows.max(initial=0.0), 'bound': bounds.max(initial=0.0), 'pair': pairs.max(initial=0.0)}
        return '; '.join(f'{name} violated by {amount:.1e}' for name, amount in worst.items() if amount > FEASIBLE)

    def linear_descent(self, w):
        """Descent in the LP of some branch, or ''."""
        g, G, H, J = self._at(w)
        gradient = np.asarray(self._f(w)[1]).ravel()
        reach, p = np.maximum(1.0, np.abs(w)), self._p
        box = np.minimum(np.maximum(-reach, p.lb - w), 0.0), np.maximum(np.minimum(reach, p.ub - w), 0.0)
        for zero in itertools.islice(self._assignments(G, H, ACTIVE), 4 * BRANCHES):
            first = np.concatenate([zero == 0, zero == 1])
            low = np.concatenate([np.minimum(p.low - g, 0.0), np.where(first, 0.0, -np.maximum(np.concatenate([G, H]), 0.0))])
            high = np.concatenate([np.maximum(p.high - g, 0.0), np.where(first, 0.0, np.inf)])
            up, down = np.isfinite(high), np.isfinite(low)
            A, b = np.vstack([J[up], -J[down]]), np.concatenate([high[up], -low[down]])
            found = linprog(gradient, A_ub=A, b_ub=b, bounds=np.column_stack(box), method='highs')
            if found.status == 0 and found.fun < -DESCENT * max(1.0, np.abs(gradient * reach).max()):
                return f'the LP of branch {zero.tolist()} descends by {-found.fun:.1e}'
        return ''

    def descent(self, w):
        """A clearly lower point near ``w`` in some branch, or ''."""
        _, G, H, _ = self._at(w)
        here, reach, p = float(self._f(w)[0]), NEAR * np.maximum(1.0, np.abs(w)), self._p
        for zero in itertools.islice(self._assignments(G, H, NEAR), BRANCHES):
            lbx, ubx = np.maximum(p.lb, w - reach), np.minimum(p.ub, w + reach)
            found = self._solve(self._nlp, w, np.minimum(lbx, ubx), ubx, zero)
            if found is not None and found[1] < here - LOWER * max(1.0, np.abs(np.asarray(self._f(w)[1])).max()):
                return f'branch {zero.tolist()} has a point lower by {here - found[1]:.1e} nearby'
        return ''

    def feasible_branch(self):
        """A branch with a feasible point, or None."""
        p = self._p
        if p.point is not None:
            return 'of the known point'
        random = np.random.default_rng(p.seed)
        for zero in itertools.product((0, 1), repeat=self._q):
            for k in range(3):
                start = p.start if k == 0 else random.normal(size=len(p.start)) * 3
                if self._solve(self._feasible, np.clip(start, p.lb, p.ub), p.lb, p.ub, np.array(zero)) is not None:
                    return zero
        return None

    def falls(self, w):
        """Whether ``w`` is far away, feasible for its size, and very low."""
        if not np.isfinite(w).all() or np.abs(w).max() < FAR:
            return False
        g, G, H, J = self._at(w)
        p, size = self._p, np.maximum(1.0, np.abs(J) @ np.abs(w))
        rows = np.maximum(p.low - g, g - p.high) / size[: self._m]
        pairs = np.minimum(G, H) / size[self._m : self._m + self._q]
        return max(rows.max(initial=0.0), pairs.max(initial=0.0)) <= FEASIBLE and float(self._f(w)[0]) < DEEP

    def _solve(self, solver, w, lbx, ubx, zero):
        """(point, objective) of a branch within bounds, or None."""
        first = np.concatenate([zero == 0, zero == 1])
        lbg = np.concatenate([self._p.low, np.zeros(2 * self._q)])
        ubg = np.concatenate([self._p.high, np.where(first, 0.0, np.inf)])
        try:
            answer = solver(x0=w, lbx=lbx, ubx=ubx, lbg=lbg, ubg=ubg)
        except RuntimeError:
            return None
        x = np.asarray(answer['x']).ravel()
        g = np.asarray(answer['g']).ravel()
        miss = max(np.max(lbg - g, initial=0.0), np.max(g - ubg, initial=0.0))
        return (x, float(answer['f'])) if miss <= 1e-8 else None

    def _assignments(self, G, H, tolerance):
        """Every choice of zero sides among pairs that are bi-active to ``tolerance``, the present one first."""
        now = np.where(G <= H, 0, 1)
        both = np.flatnonzero(np.maximum(G, H) <= tolerance)
        for flips in itertools.product((0, 1), repeat=len(both)):
            zero = now.copy()
            zero[both] ^= np.array(flips, dtype=int)
            yield zero

    def _at(self, w):
        values, J = (np.asarray(v) for v in self._rows(w))
        values = values.ravel()
        return values[: self._m], values[self._m : self._m + self._q], values[self._m + self._q :], J.reshape(-1, len(w))
