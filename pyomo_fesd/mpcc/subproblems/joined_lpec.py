"""The LPEC of a model with a copy of one of its parts, assembled from matrices of the model itself.

    rows of the model            at the point; those of the part after the copy begin with the last values of the copy
    rows of the copied part      at the values of the copy, in columns of its own; they begin with the last values before it
    shared rows and objective    get the column of the extent of the copy; where that is 0, no other variable inside it matters

A copy behind part k ends where k ended.  So it takes over from k the conditions on its end, and what shared rows and objective have
of its last values.

Takes: the LPEC at the point, and gradients at the point, beside the copy, and in the copy.
Leaves: a ``Linearised`` LPEC, whose last variables are those of the copy.
Does not apply: where objective or shared rows are not sums over the parts; where such last values change with the mode.
"""

from dataclasses import replace

import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.subproblems.active_set import FREE
from pyomo_fesd.mpcc.subproblems.descent import Descent
from pyomo_fesd.mpcc.subproblems.linear_program import Program
from pyomo_fesd.mpcc.subproblems.lpec import Linearised, row_places, sizes_of
from pyomo_fesd.mpcc.subproblems.parts import SHARED

#: Agreement of gradients, relative to the largest one, and of values.
SAME = 1e-6


class JoinedLpec:
    """Joins the model and the copy of one insertion; ``following`` is the part after the copy."""

    def __init__(self, c, sides, parts, insertion, following, sets, equal):
        self._c, part, n = c, parts.all[insertion.k], len(c.x0)
        self.rows, self.own = np.flatnonzero(parts.of_row == insertion.k), part.own
        self._n, self._extent = n, part.extent
        self._program_rows = np.concatenate(row_places(sets, equal, len(c.lbg)))
        self._last = 2 * int(sets.gamma.sum())
        place = {j: n + i for i, j in enumerate(part.own)}
        passed_on = dict(zip(part.first, part.last)) if insertion.ahead else {j: j for j in part.last}
        self._of_following = {j: place[last] for j, last in passed_on.items() if last in place}
        self._of_copy = place | ({} if insertion.ahead else dict(zip(part.first, part.last)))
        still = sides.fixed_by(sets.zero, parts.of_pair == following)
        self.fixed_by_following = [passed_on[j] for j in still if j in self._of_following]
        self._follows = parts.of_row[self._program_rows] == following
        self._shares = parts.of_row[self._program_rows] == SHARED
        self._parts, self._following, self._k = parts, following, insertion.k
        # pairs are no sums over the parts, and no part with pairs as conditions on its end is copied
        self._shared_rows = self._shares & (self._program_rows < len(c.lbg))
        self._end_rows = np.isin(self._program_rows, np.intersect1d(self.rows, np.flatnonzero(parts.of_copies.is_condition)))
        # a copy behind part k ends where that ended
        self._ends = {} if insertion.ahead else {j: place[j] for j in part.ends}
        # a condition on the end of k, and on the end of the part before it, does not begin with the copy ahead of k
        self._begins = self._follows & ~self._end_rows

    def with_following(self, base, other):
        """The LPEC with the rows and variables of the part after the copy linearised at another point."""
        return self._with_part(base, other, self._following)

    def _with_part(self, base, other, k):
        """The LPEC with the rows and variables of part ``k`` linearised at another point."""
        p, q = base.program, other.program
        of_rows, of_variables = self._parts.of_row[self._program_rows] == k, self._parts.of_variable == k
        low, high = (np.where(of_rows, new, old) for old, new in ((p.low, q.low), (p.high, q.high)))
        lower, upper = (np.where(of_variables, new, old) for old, new in ((p.lower, q.lower), (p.upper, q.upper)))
        half = self._last // 2
        G, H = (of_rows[len(of_rows) - self._last :][side] for side in (slice(half), slice(half, None)))
        program = replace(p, low=low, high=high, lower=lower, upper=upper)
        return replace(base, program=program, G=np.where(G, other.G, base.G), H=np.where(H, other.H, base.H))

    def gradients(self, points):
        """Gradient of the objective and Jacobian of all rows at each point."""
        return [(self._c.gradients(at)[0], self._c.stacked_jacobian(at)) for at in points]

    def is_known(self, here, there) -> bool:
        """Whether objective and shared rows are sums over the parts, and the copy ends with the values that it takes over.

        Parameters
        ----------
        here, there : arrays (n)
            the point, and that in the copy
        """
        (cost, A), (cost_of_copy, of_copy) = self.gradients((here, self._in_place(here, there)))
        rows = self._program_rows[self._shared_rows]
        others = (self._parts.of_variable >= 0) & (self._parts.of_variable != self._k)
        sums = agree(cost[others], cost_of_copy[others]) and agree(A[rows][:, others].data, of_copy[rows][:, others].data)
        ends = np.array(list(self._ends), dtype=int)
        rows = of_copy[np.union1d(rows, self._program_rows[self._end_rows])][:, ends]
        matter = self._parts.of_copies.is_bounded[ends] | (cost_of_copy[ends] != 0.0) | (np.diff(rows.tocsc().indptr) > 0)
        change = np.abs(there - here)[ends] > SAME * sizes_of(here[ends])
        return sums and not np.any(matter & change)

    def _in_place(self, here, there):
        """The point ``here`` with the values of the copy in place of those of the part."""
        found = here.copy()
        found[self.own] = there[self.own]
        return found

    def best(self, lpec, sets, base, points, credit, limits, fixed):
        """The best direction of the LPEC with the copy, which grows at ``credit`` more for each unit.

        The first of the ``points`` is the one without a copy; the variables ``fixed`` of the copy do not move.
        """
        base = replace(base, program=self._unfixed(lpec, points[0], sets, base.program))
        at = self.linearised(base, self.gradients(points), credit, limits, fixed)
        descent = Descent(at.program, lambda: [(cost, A.T.dot) for cost, A in self.changes(*map(lpec.changes, points))])
        return lpec.best(sets, at, descent, True)

    def linearised(self, base, points, credit, limits, fixed):
        """The LPEC with the copy, without its binaries."""
        p, y, (low, high, lower, upper, reach) = self._with_fixed(base.program, fixed), self._last, limits
        cost, A = self._joined(*points)
        cost[self._place_of_extent] += credit
        low, high = (self._inserted(given, new) for given, new in ((p.low, low), (p.high, high)))
        lower, upper, reach = map(np.concatenate, ((p.lower, lower), (p.upper, upper), (p.reach, reach)))
        self._pass_on_bounds(lower, upper, reach)
        program = Program(cost, A, low, high, lower, upper, reach)
        half = A.shape[0] - y // 2
        return Linearised(program, base.equal, base.G, base.H, A[A.shape[0] - y : half], A[half:])

    def _pass_on_bounds(self, lower, upper, reach):
        """Make bounds that are conditions on the end of k those of the end of the copy behind it."""
        for j, of_copy in self._ends.items():
            if self._parts.of_copies.is_bounded[j]:
                # one that its sides fix has bounds no longer; without those of the copy there is only more descent
                if lower[j] < upper[j] or self._c.lbx[j] == self._c.ubx[j]:
                    lower[of_copy], upper[of_copy] = max(lower[of_copy], lower[j]), min(upper[of_copy], upper[j])
                lower[j], upper[j] = -reach[j], reach[j]

    def _unfixed(self, lpec, w, sets, program):
        """A program in which first values of the part after the copy are not fixed by its sides: they are those of the copy now."""
        sets = replace(sets, zero=np.where(self._parts.of_pair == self._following, FREE, sets.zero))
        (lower, upper), j = lpec.box(w, sets, program.reach, beyond=True), list(self._of_following)
        low, high = program.lower.copy(), program.upper.copy()
        low[j], high[j] = lower[j], upper[j]
        return replace(program, lower=low, upper=high)

    def _with_fixed(self, program, fixed):
        """A program in which variables that the sides of the copy fix do not move."""
        j = np.array([self._of_copy.get(i, i) for i in fixed], dtype=int)
        low, high = program.lower.copy(), program.upper.copy()
        low[j[j < self._n]] = high[j[j < self._n]] = 0.0
        return replace(program, lower=low, upper=high)

    def changes(self, *points):
        """Changes of cost and rows along displacements."""
        return [self._joined(*of_points) for of_points in zip(*points)]

    def _inserted(self, given, new):
        """Rows of bi-active pairs stay the last ones."""
        cut = len(given) - self._last
        return np.concatenate([given[:cut], new, given[cut:]])

    def _joined(self, here, beside, there):
        """Cost and rows of the model with the copy, of those at the point, beside the copy, and in the copy."""
        (cost, A), (_, of_following), (cost_of_copy, of_copy) = here, beside, there
        follows = sparse.diags(self._follows.astype(float))
        A = A[self._program_rows]
        A = A + follows @ (of_following[self._program_rows] - A)
        ends, ends_of_copy = list(self._ends), list(self._ends.values())
        cost = np.concatenate([cost, np.zeros(len(self.own))])
        cost[[self._place_of_extent, *ends_of_copy]] = cost_of_copy[[self._extent, *ends]]
        cost[ends] -= cost_of_copy[ends]
        base = self._with_columns(A, self._begins, self._of_following)
        base = self._with_columns(base, self._end_rows, self._ends)
        base = base + self._entries(of_copy, self._shares, [self._extent], [self._place_of_extent])
        passed_on, given_up = (self._entries(of_copy, self._shared_rows, ends, columns) for columns in (ends_of_copy, ends))
        base = base + passed_on - given_up
        new = self._with_columns(of_copy[self.rows], np.ones(len(self.rows), dtype=bool), self._of_copy)
        cut = base.shape[0] - self._last
        return cost, sparse.vstack([base[:cut], new, base[cut:]], format='csr')

    @property
    def _place_of_extent(self):
        return self._n + int(np.flatnonzero(self.own == self._extent)[0])

    def _entries(self, A, chosen, given, columns):
        """Entries of the ``chosen`` rows of the program in the columns ``given``, moved to other ``columns``, and nothing else."""
        found = (sparse.diags(chosen.astype(float)) @ A[self._program_rows])[:, given].tocoo()
        columns = np.array(columns, dtype=int)[found.col]
        return sparse.csr_matrix((found.data, (found.row, columns)), (found.shape[0], self._n + len(self.own)))

    def _with_columns(self, A, chosen, places):
        """Rows in the columns of the model and of the copy; entries of the ``chosen`` rows move to other ``places``."""
        entries, move = A.tocoo(), np.arange(self._n + len(self.own))
        move[list(places)] = list(places.values())
        columns = np.where(chosen[entries.row], move[entries.col], entries.col)
        return sparse.csr_matrix((entries.data, (entries.row, columns)), (A.shape[0], self._n + len(self.own)))


def agree(a, b) -> bool:
    """Whether two gradients are the same."""
    return bool(np.abs(a - b).max(initial=0.0) <= SAME * max(1.0, np.abs(a).max(initial=0.0)))


def linearised_at_both(lpec, w, other, sets, radius, equal):
    """Active sets, decisions and LPECs at two points; None where they are not of the same form."""
    (sets, equal, base), (others, _, there) = (lpec.linearised(at, sets, radius, equal, beyond=True) for at in (w, other))
    if not (sets.same_sides(others) and np.array_equal(sets.gamma, others.gamma)):
        return None
    return sets, equal, base, there
