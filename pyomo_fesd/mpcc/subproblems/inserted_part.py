"""Values of a part that is inserted beside another one, with a small extent.

The rows of the other part, its first values and the sides of its pairs that are zero determine the values of the copy:

    rows = bounds where both are equal,   zero sides = 0,   first values, extent and what parts share given

A zero side that is a sum of rows and variables, which their bounds keep non-negative, makes each of them 0.  All other bounds are
not used, so that the values show whether they hold.

Takes: a point, the part, and zero sides.
Leaves: the point with the values of the copy in place of those of the part; None where they are not determined.
"""

import numpy as np
from scipy import sparse
from scipy.optimize import linprog, nnls
from scipy.sparse.linalg import LinearOperator, norm, onenormest, splu

from pyomo_fesd.mpcc.compile import with_entries

#: Newton steps; residual of the rows, each over its largest entry, and last step, at which they end.
STEPS, RESIDUAL, LAST_STEP = 30, 1e-10, 1e-7
#: Equations that leave more than this, relative to their terms, contradict each other; the point at which they are compared.
CONTRADICTION, SEED = 1e-5, 0
#: Agreement of a side with a sum of rows.
EXACT = 1e-9
#: Singular values below this, relative to the largest one, are zero: extents enter with their square.
SINGULAR = 1e-13
#: A direction with more of a variable in it, that changes no equation, leaves the variable undetermined.
UNDETERMINED = 1e-6
#: Part of the condition number that belongs to this, up to which an estimate shows that no singular value is zero.
CLEARLY = 1e-2


class InsertedPart:
    """The equations of a part at one assignment.

    Parameters
    ----------
    c : MpccFunctions
    sides : Sides
    parts : Parts
    columns : int array
        variables to determine
    rows : int array
        stacked numbers of the rows among which the equations are
    zero : int array (q)
        zero sides of all pairs; only those among the rows count

    Attributes
    ----------
    determined : bool
        whether the equations determined all values when they were solved last
    """

    def __init__(self, c, sides, parts, columns, rows, zero):
        self._c, self._m, self._q = c, len(c.lbg), c.pairs
        self._rows, self._gates = rows, parts.is_gate
        self._zero_rows = np.zeros(self._m + 2 * self._q + c.equal.numel(), dtype=bool)
        self._zero_rows[self._m : self._m + 2 * self._q] = sides.zero_rows(zero)
        self._low = np.concatenate([c.lbg, np.zeros(2 * self._q), np.full(c.equal.numel(), -np.inf)])
        self._high = np.concatenate([c.ubg, np.full(2 * self._q + c.equal.numel(), np.inf)])
        self._columns, self.determined = columns, True

    def solve(self, w, any_of=False):
        """``w`` with the values that the equations determine; None if they are not determined, or not found.

        With ``any_of`` values need not be determined: those beside the given ones are taken.
        """
        rows, fixed, at = self._equations(w)
        w = w.copy()
        w[fixed] = at
        free = np.setdiff1d(self._columns, fixed)
        for _ in range(STEPS):
            A, residual, scale = self._scaled(w, rows, free)
            step, determined = self._step(A, residual, w, free)
            w[free] += step
            if _is_last(step, w[free]):
                left = np.abs((self._values(w) - self._low)[rows] / scale).max(initial=0.0)
                self.determined = determined
                return w if (determined or any_of) and left <= RESIDUAL else None
        return None

    def contradict(self, w) -> bool:
        """Whether no values within their bounds satisfy the equations that are linear in the variables to determine."""
        A, residual, free, _ = self._linear(w)
        return _least_violation(A, residual, self._c.lbx[free] - w[free], self._c.ubx[free] - w[free]) > CONTRADICTION

    def contradiction(self, w, others):
        """What is left of a sum of these linear equations in which the variables to determine cancel, and its gradient.

        The sum has factors of length 1; the variables ``others`` cancel too.  None where the equations have a solution.
        """
        A, residual, _, J = self._linear(w)
        A = np.hstack([A, J[:, others].toarray()])
        left = residual - A @ np.linalg.lstsq(A, residual, rcond=SINGULAR)[0]
        size = np.linalg.norm(left)
        if size <= RESIDUAL * max(1.0, np.abs(residual).max(initial=0.0)):
            return None
        gradient = J.T @ (left / size)
        gradient[self._columns] = gradient[others] = 0.0
        return size, gradient

    def _linear(self, w):
        """Equations that are linear in the variables to determine: A, residual, these variables, and the whole Jacobian."""
        rows, fixed, at = self._equations(w)
        w = w.copy()
        w[fixed] = at
        free, other = np.setdiff1d(self._columns, fixed), w.copy()
        other[free] += np.random.default_rng(SEED).uniform(0.1, 1.0, len(free))
        J, there = (self._c.stacked_jacobian(at)[rows] for at in (w, other))
        A = J[:, free].toarray()
        linear = np.abs(A - there[:, free].toarray()).max(axis=1, initial=0.0) <= EXACT
        terms = np.maximum(1.0, abs(J) @ np.abs(w))[linear]
        residual = (self._values(w) - self._low)[rows][linear] / terms
        return A[linear] / terms[:, None], residual, free, sparse.diags(1 / terms) @ J[linear]

    def nearest(self, w):
        """``w`` with the values to determine where the equations hold best (Gauss-Newton), whatever else is in them."""
        rows, fixed, at = self._equations(w)
        w = w.copy()
        w[fixed] = at
        free = np.setdiff1d(self._columns, fixed)
        for _ in range(STEPS):
            A, residual, _ = self._scaled(w, rows, free)
            step = np.linalg.lstsq(A.toarray(), -residual, rcond=None)[0]
            w[free] += step
            if _is_last(step, w[free]):
                break
        return w

    def missed(self, w) -> float:
        """By how much ``w`` misses a row of the part, relative to its terms, at most."""
        rows, values = self._rows, self._values(w)
        high = np.where(self._zero_rows, 0.0, self._high)
        terms = np.maximum(1.0, abs(self._c.stacked_jacobian(w)[rows]) @ np.abs(w))
        return float((np.maximum(self._low - values, values - high)[rows] / terms).max(initial=0.0))

    def determine(self, w, row) -> bool:
        """Whether the equations determine the value of a row."""
        J = self._c.stacked_jacobian(w)
        rows, fixed, _ = self._equations(w)
        free = np.setdiff1d(self._columns, fixed)
        gradient, basis = J[row].toarray().ravel()[free], (sparse.diags(1 / _largest(J[rows])) @ J[rows])[:, free].toarray().T
        left = gradient - basis @ np.linalg.lstsq(basis, gradient, rcond=SINGULAR)[0]
        return bool(np.abs(left).max(initial=0.0) <= UNDETERMINED * max(1.0, np.abs(gradient).max(initial=0.0)))

    def slopes(self, w, row):
        """Derivatives of a row where the equations hold, by all variables that they do not determine."""
        J = self._c.stacked_jacobian(w)
        rows, fixed, _ = self._equations(w)
        free, found = np.setdiff1d(self._columns, fixed), J[row].toarray().ravel()
        A = sparse.diags(1 / _largest(J[rows])) @ J[rows]
        weights = _solution(A[:, free].T, found[free])
        if weights is None:
            weights = np.linalg.lstsq(A[:, free].toarray().T, found[free], rcond=None)[0]
        found = found - A.T @ weights
        found[self._columns] = 0.0
        return found

    def left_free(self, w, gradient):
        """The part of a gradient that the equations leave: its distance from the space that their gradients span."""
        J = self._c.stacked_jacobian(w)
        rows, fixed, _ = self._equations(w, all_free=True)
        basis = (sparse.diags(1 / _largest(J[rows])) @ J[rows]).toarray()
        some = np.flatnonzero(np.any(basis != 0.0, axis=0) | (gradient != 0.0))
        some = some[~np.isin(some, fixed)]
        weights = np.linalg.lstsq(basis[:, some].T, gradient[some], rcond=SINGULAR)[0]
        return float(np.abs(gradient[some] - basis[:, some].T @ weights).max(initial=0.0))

    def _scaled(self, w, rows, free):
        """Jacobian of the rows by free variables and residual, each row over its largest entry; and these entries."""
        J = self._c.stacked_jacobian(w)[rows]
        scale = _largest(J)
        return (sparse.diags(1 / scale) @ J)[:, free], (self._values(w) - self._low)[rows] / scale, scale

    def _values(self, w):
        at = self._c.evaluate(w)
        return np.concatenate([at.g, at.G, at.H, np.zeros(self._c.equal.numel())])

    def _equations(self, w, all_free=False):
        """Rows that are equations of variables to determine, or of any; variables that are fixed, and their values."""
        J, values, rows = self._c.stacked_jacobian(w), self._values(w), self._rows
        pattern = with_entries(J[: self._m], np.ones(J.indptr[self._m]))
        equations = rows[self._low[rows] == self._high[rows]].tolist()
        fixed = {}
        for row in rows[self._zero_rows[rows]]:
            of_rows, of_variables = self._parts_of_sum(J, pattern, values, w, row)
            equations += of_rows
            fixed |= of_variables
        own = set(self._columns.tolist())
        fixed = {j: value for j, value in fixed.items() if all_free or j in own}
        free = np.full(J.shape[1], all_free)
        free[self._columns] = True
        free[list(fixed)] = False
        equations = np.unique(np.array(equations, dtype=int))
        has_free = abs(J[equations]) @ free.astype(float) > 0
        return equations[has_free], np.array(list(fixed), dtype=int), np.array(list(fixed.values()))

    def _parts_of_sum(self, J, pattern, values, w, row):
        """Rows at 0 and variables at bounds of which a zero side is a sum; the row itself if it is not.

        ``pattern`` is that of the model's own rows.
        """
        entries, m = J[row], self._m
        columns, inside = entries.indices, np.zeros(J.shape[1], dtype=float)
        inside[columns] = 1.0
        support = np.diff(pattern.indptr)
        among = np.flatnonzero((support > 0) & (pattern @ inside == support) & np.isfinite(self._low[:m]))
        among = among[self._low[among] < self._high[among]]
        lower, upper = (columns[np.isfinite(bound[columns])] for bound in (self._c.lbx, self._c.ubx))
        unit = np.eye(len(columns))
        of_bounds = [unit[np.isfinite(self._c.lbx[columns])], -unit[np.isfinite(self._c.ubx[columns])]]
        basis = np.vstack([J[among][:, columns].toarray(), *of_bounds]).T
        weights, left = nnls(basis, entries.data) if basis.shape[1] else (np.zeros(0), np.inf)
        terms = np.concatenate([values[among] - self._low[among], w[lower] - self._c.lbx[lower], self._c.ubx[upper] - w[upper]])
        constant = values[row] - weights @ terms if len(weights) else np.inf
        if max(left, abs(constant)) > EXACT * max(1.0, np.abs(entries.data).max(initial=0.0), np.abs(w[columns]).max(initial=0.0)):
            return [row], {}
        of_rows, of_lower, of_upper = np.split(weights > EXACT, np.cumsum([len(among), len(lower)]))
        fixed = {j: self._c.lbx[j] for j in lower[of_lower]} | {j: self._c.ubx[j] for j in upper[of_upper]}
        return among[of_rows].tolist(), fixed

    def _step(self, A, residual, w, free):
        """A Newton step of least length, the variables of gates within their bounds; and whether all others are determined."""
        step = None if self._gates[free].any() else _solution(A, -residual)
        return self._least_step(A.toarray(), residual, w, free) if step is None else (step, True)

    def _least_step(self, A, residual, w, free):
        """The step of least length in which gates, and what the equations leave undetermined, stay within their bounds."""
        gates, low, high = self._gates[free], self._c.lbx[free], self._c.ubx[free]
        bound = np.full(len(free), np.nan)
        for _ in range(1 + len(free)):
            inner = np.isnan(bound)
            step = np.where(inner, 0.0, bound - w[free])
            U, s, Vt = np.linalg.svd(A[:, inner]) if inner.any() and len(A) else (np.eye(len(A)), np.zeros(0), np.eye(inner.sum()))
            rank = int(np.count_nonzero(s > SINGULAR * s.max(initial=0.0)))
            target = -residual - A[:, ~inner] @ step[~inner]
            step[inner] = Vt[:rank].T @ ((U[:, :rank].T @ target) / s[:rank])
            loose = np.zeros(len(free), dtype=bool)
            loose[inner] = np.abs(Vt[rank:]).max(axis=0, initial=0.0) > UNDETERMINED
            reached = w[free] + step
            below, above = (gates & inner | loose) & (reached < low - EXACT), loose & (reached > high + EXACT)
            if not (below | above).any():
                return step, not np.any((loose | ~inner) & ~gates)
            bound[below], bound[above] = low[below], high[above]
        return step, False


def _solution(A, b):
    """The solution of a square sparse system; None if its matrix may be singular, or is not square."""
    if A.shape[0] != A.shape[1] or not A.shape[0]:
        return None
    try:
        factors = splu(A.tocsc())
    except RuntimeError:
        return None
    inverse = LinearOperator(A.shape, factors.solve, lambda y: factors.solve(y, 'T'), dtype=float)
    step = factors.solve(b)
    # an estimate from below: beyond a hundredth of the limit the singular values decide
    is_clear = np.isfinite(step).all() and onenormest(inverse) * norm(A, 1) < CLEARLY / SINGULAR
    return step if is_clear else None


def _is_last(step, values):
    """Whether the Newton steps end with this one."""
    return np.abs(step).max(initial=0.0) <= LAST_STEP * max(1.0, np.abs(values).max(initial=0.0))


def _least_violation(A, residual, low, high):
    """The least largest entry of ``|residual + A step|`` over steps between bounds; 0 if it is not found."""
    if not len(A):
        return 0.0
    cost, of_all = np.append(np.zeros(A.shape[1]), 1.0), -np.ones((len(A), 1))
    rows = np.vstack([np.hstack([A, of_all]), np.hstack([-A, of_all])])
    bounds = np.column_stack([np.append(low, 0.0), np.append(high, np.inf)])
    found = linprog(cost, rows, np.concatenate([-residual, residual]), bounds=bounds)
    return found.fun if found.status == 0 else 0.0


def _largest(J):
    found = abs(J).max(axis=1).toarray().ravel() if J.shape[0] else np.zeros(0)
    return np.where(found > 0, found, 1.0)
