"""The LPEC of a model with copies of its parts in a row, assembled from matrices of the model itself.

    rows of the model            at the point; those of the part after the copies begin with the last values of the last copy
    rows of each copied part     at the values of the copy, in columns of its own; they begin with the last values before it
    shared rows and objective    get the column of the extent of each copy; where that is 0, no other variable inside it matters

A copy behind part k ends where k ended.  So the last one behind k takes over from k the conditions on its end, and what shared
rows and objective have of its last values.

Takes: the LPEC at the point, and gradients at the point, beside the copies, and in each copy.
Leaves: a ``Linearised`` LPEC, whose last variables are those of the copies, one after the other.
Does not apply: where objective or shared rows are not sums over the parts; where such last values change with the mode.
"""

from dataclasses import replace

import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.subproblems.active_set import FREE
from pyomo_fesd.mpcc.subproblems.copy_columns import columns_of_row
from pyomo_fesd.mpcc.subproblems.descent import Descent
from pyomo_fesd.mpcc.subproblems.linear_program import Program
from pyomo_fesd.mpcc.subproblems.lpec import row_places, sizes_of
from pyomo_fesd.mpcc.subproblems.parts import SHARED

#: Agreement of gradients, relative to the largest one, and of values.
SAME = 1e-6


class JoinedLpec:
    """Joins the model and copies of parts.

    Parameters
    ----------
    insertions : tuple of Insertion
        one after the other, those behind a part first
    following : int
        the part after the copies

    Attributes
    ----------
    copies : list of CopyColumns
    """

    def __init__(self, c, sides, parts, insertions, following, sets, equal):
        self._c, self._n, self._parts, self._following = c, len(c.x0), parts, following
        self.copies = columns_of_row(parts, insertions, self._n)
        self._width = self._n + sum(len(copy.own) for copy in self.copies)
        self._program_rows = np.concatenate(row_places(sets, equal, len(c.lbg)))
        self._last = 2 * int(sets.gamma.sum())
        self._still = sides.fixed_by(sets.zero, parts.of_pair == following)
        self._follows = parts.of_row[self._program_rows] == following
        self._shares = parts.of_row[self._program_rows] == SHARED
        # pairs are no sums over the parts, and no part with pairs as conditions on its end is copied
        self._shared_rows = self._shares & (self._program_rows < len(c.lbg))
        own = self._program_rows < len(c.lbg)
        is_condition = np.zeros(len(own), dtype=bool)
        is_condition[own] = parts.of_copies.is_condition[self._program_rows[own]]
        # copies ahead of the part after them come between a condition on its end and the values before it that this contains
        self._begins, self._condition_begins = self._follows & ~is_condition, self._follows & is_condition
        self._end_rows = is_condition & (parts.of_row[self._program_rows] == self.copies[0].k) & ~self._follows

    def with_following(self, base, other):
        """The LPEC with the rows and variables of the part after the copies linearised at another point."""
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

    def is_known(self, here, *there) -> bool:
        """Whether objective and shared rows are sums over the parts, and copies end with the values that they take over.

        Parameters
        ----------
        here : array (n)
            the point
        there : arrays (n)
            those in the copies
        """
        (before, *points) = self.gradients((here, *(copy.in_place(here, at) for copy, at in zip(self.copies, there))))
        return all(self._is_known(copy, before, of_copy, here, at) for copy, of_copy, at in zip(self.copies, points, there))

    def _is_known(self, copy, at_point, in_copy, here, there):
        (cost, A), (cost_of_copy, of_copy) = at_point, in_copy
        rows = self._program_rows[self._shared_rows]
        others = (self._parts.of_variable >= 0) & (self._parts.of_variable != copy.k)
        sums = agree(cost[others], cost_of_copy[others]) and agree(A[rows][:, others].data, of_copy[rows][:, others].data)
        ends = np.array(list(copy.ends), dtype=int)
        rows = of_copy[np.union1d(rows, self._program_rows[self._end_rows])][:, ends]
        matter = self._parts.of_copies.is_bounded[ends] | (cost_of_copy[ends] != 0.0) | (np.diff(rows.tocsc().indptr) > 0)
        change = np.abs(there - here)[ends] > SAME * sizes_of(here[ends])
        return sums and not np.any(matter & change)

    def searched(self, lpec, sets, base, points, credits, limits, fixed, enough):
        """A direction of the LPEC with the copies, which grow at the ``credits`` more for each unit; see ``Lpec.searched``.

        The first of the ``points`` is the one without copies; ``limits`` and variables that are ``fixed`` are those of each copy.
        """
        base = replace(base, program=self._unfixed(lpec, points[0], sets, base.program))
        at = self.linearised(base, self.gradients(points), credits, limits, fixed)
        descent = Descent(at.program, lambda: [(cost, A.T.dot) for cost, A in self.changes(*map(lpec.changes, points))])
        return lpec.searched(sets, at, descent, enough)

    def linearised(self, base, points, credits, limits, fixed):
        """The LPEC with the copies, without its binaries."""
        p = self._with_fixed(base.program, fixed)
        low, high, lower, upper, reach = (list(of_copies) for of_copies in zip(*limits))
        cost, A = self._joined(*points)
        cost[self._places_of_extents] += credits
        low, high = (self._inserted(given, new) for given, new in ((p.low, low), (p.high, high)))
        of_variables = (p.lower, lower), (p.upper, upper), (p.reach, reach)
        lower, upper, reach = (np.concatenate([given, *new]) for given, new in of_variables)
        still = self._fixed_ends(fixed)
        lower[still] = upper[still] = 0.0
        self._pass_on_bounds(lower, upper, reach)
        # drifts that pairs decide stay free, which only adds directions: those of the copies are not known
        return replace(base, program=Program(cost, A, low, high, lower, upper, reach), drifts=[])

    def _pass_on_bounds(self, lower, upper, reach):
        """Make bounds that are conditions on the end of k those of the end of the last copy behind it."""
        for j, of_copy in self._ends.items():
            if self._parts.of_copies.is_bounded[j]:
                # one that its sides fix has bounds no longer; without those of the copy there is only more descent
                if lower[j] < upper[j] or self._c.lbx[j] == self._c.ubx[j]:
                    lower[of_copy], upper[of_copy] = max(lower[of_copy], lower[j]), min(upper[of_copy], upper[j])
                lower[j], upper[j] = -reach[j], reach[j]

    def _unfixed(self, lpec, w, sets, program):
        """A program in which the sides of the part after the copies do not fix its first values: they are the last copy's."""
        sets = replace(sets, zero=np.where(self._parts.of_pair == self._following, FREE, sets.zero))
        (lower, upper), j = lpec.box(w, sets, program.reach, beyond=True), list(self._passed_on)
        low, high = program.lower.copy(), program.upper.copy()
        low[j], high[j] = lower[j], upper[j]
        return replace(program, lower=low, upper=high)

    def _with_fixed(self, program, fixed):
        """A program in which values at the boundary that the sides of the first copy fix, and those of no part, do not move."""
        low, high = program.lower.copy(), program.upper.copy()
        of_model = [copy.of_model(some) for copy, some in zip(self.copies, fixed)]
        j = of_model[0] + [j for some in of_model[1:] for j in some if self._parts.of_variable[j] < 0]
        low[j] = high[j] = 0.0
        return replace(program, lower=low, upper=high)

    def _fixed_ends(self, fixed) -> list:
        """Columns of last values of copies that the sides of what follows them fix."""
        follow = [copy.of_model(some) for copy, some in zip(self.copies[1:], fixed[1:])]
        return [j for copy, some in zip(self.copies, [*follow, self._still]) for j in copy.at_its_end(some)]

    def changes(self, *points):
        """Changes of cost and rows along displacements."""
        return [self._joined(*of_points) for of_points in zip(*points)]

    def _inserted(self, given, new):
        """Rows of bi-active pairs stay the last ones."""
        cut = len(given) - self._last
        return np.concatenate([given[:cut], *new, given[cut:]])

    def _joined(self, here, beside, *there):
        """Cost and rows of the model with the copies, of those at the point, beside the copies, and in each copy."""
        (cost, A), (_, of_following) = here, beside
        follows = sparse.diags(self._follows.astype(float))
        A = A[self._program_rows]
        A = A + follows @ (of_following[self._program_rows] - A)
        base = self._with_columns(A, self._begins, self._passed_on)
        base = self._with_columns(base, self._condition_begins, self._of_end.passed_on if self._of_end else {})
        base = self._with_columns(base, self._end_rows, self._ends)
        cost, new = np.concatenate([cost, np.zeros(self._width - self._n)]), []
        for copy, (cost_of_copy, of_copy) in zip(self.copies, there):
            ends, of_ends = list(copy.ends), list(copy.ends.values())
            cost[[copy.place_of_extent, *of_ends]] = cost_of_copy[[copy.extent, *ends]]
            cost[ends] -= cost_of_copy[ends]
            base = base + self._entries(of_copy, self._shares, [copy.extent], [copy.place_of_extent])
            passed_on, given_up = (self._entries(of_copy, self._shared_rows, ends, columns) for columns in (of_ends, ends))
            base = base + passed_on - given_up
            new.append(self._with_columns(of_copy[copy.rows], np.ones(len(copy.rows), dtype=bool), copy.columns))
        cut = base.shape[0] - self._last
        return cost, sparse.vstack([base[:cut], *new, base[cut:]], format='csr')

    @property
    def _passed_on(self):
        """Variables at the boundary -> columns of the values with which the part after the copies begins."""
        return self.copies[-1].passed_on

    @property
    def _ends(self):
        """Variables at the end of the part before the copies -> columns of the copy that ends there instead."""
        return self._of_end.ends if self._of_end else {}

    @property
    def _of_end(self):
        """The copy that ends where the part before the copies ended; None without one."""
        return next((copy for copy in self.copies if copy.ends), None)

    @property
    def _places_of_extents(self):
        return [copy.place_of_extent for copy in self.copies]

    def _entries(self, A, chosen, given, columns):
        """Entries of the ``chosen`` rows of the program in the columns ``given``, moved to other ``columns``, and nothing else."""
        found = (sparse.diags(chosen.astype(float)) @ A[self._program_rows])[:, given].tocoo()
        columns = np.array(columns, dtype=int)[found.col]
        return sparse.csr_matrix((found.data, (found.row, columns)), (found.shape[0], self._width))

    def _with_columns(self, A, chosen, places):
        """Rows in the columns of the model and of the copies; entries of the ``chosen`` rows move to other ``places``."""
        entries, move = A.tocoo(), np.arange(self._width)
        move[list(places)] = list(places.values())
        columns = np.where(chosen[entries.row], move[entries.col], entries.col)
        return sparse.csr_matrix((entries.data, (entries.row, columns)), (A.shape[0], self._width))


def agree(a, b) -> bool:
    """Whether two gradients are the same."""
    return bool(np.abs(a - b).max(initial=0.0) <= SAME * max(1.0, np.abs(a).max(initial=0.0)))


def linearised_at_both(lpec, w, other, sets, radius, equal):
    """Active sets, decisions and LPECs at two points; None where they are not of the same form."""
    (sets, equal, base), (others, _, there) = (lpec.linearised(at, sets, radius, equal, beyond=True) for at in (w, other))
    if not (sets.same_sides(others) and np.array_equal(sets.gamma, others.gamma)):
        return None
    return sets, equal, base, there
