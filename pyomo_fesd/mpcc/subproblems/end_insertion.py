"""Whether a part of no extent at an end of a chain may grow with descent (theory, section 4, orders).

What the part at the end held goes to a copy of the part beside it (``end_values``).  The LPEC has the columns of the model, in
which the part at the end has the extent 0, and those of the copy.

Takes: a point, and an ``EndInsertion``.
Leaves: a ``Verdict``.
Does not apply: where objective or shared rows are not sums over the parts, where pairs of the part at the end are bi-active,
beside parts of nearly no extent, and where variables say how a part begins: of those there would be more.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.subproblems.active_set import ActiveSets
from pyomo_fesd.mpcc.subproblems.end_values import EndValues
from pyomo_fesd.mpcc.subproblems.joined_lpec import JoinedLpec, agree, linearised_at_both
from pyomo_fesd.mpcc.subproblems.verdict import Verdict, charge, of_growth


class EndInsertions:
    """Judges the insertions at the ends of one compiled MPCC; parameters as of ``Insertions``."""

    def __init__(self, c, sides, parts, lpec, tolerances):
        self._c, self._sides, self._parts, self._lpec, self._tolerances = c, sides, parts, lpec, tolerances

    def verdict(self, w, sets, equal, order) -> Verdict:
        """Judge an ``EndInsertion`` into the point ``w`` with active sets ``sets`` and the decisions ``equal`` in force."""
        if not all(self._may_be_inserted(k) for k in (order.end, order.inner)):
            return Verdict.NONE
        if not self._applies(w, sets, order):
            return Verdict.UNKNOWN
        with self._c.vanishing(np.array([self._parts.all[order.end].extent])):
            values = self._values(w, sets, order)
            verdict = self._by_values(values)
            if verdict is not None:
                return verdict
            return of_growth(
                lambda credits: self._by_lpec(sets, equal, values, credits),
                lambda: [self._charge(w, sets, equal, order)],
                self._tolerances.descent,
            )

    def _may_be_inserted(self, k):
        return self._parts.may_be_copied(k) and not self._parts.all[k].gate.size and not self._parts.hands_on(k)

    def _applies(self, w, sets, order):
        end, inner = (self._parts.all[k] for k in (order.end, order.inner))
        undecided = (sets.gamma | sets.open) & (self._parts.of_pair == order.end)
        possible = inner.whole and len(end.places) == len(inner.places) and not self._parts.ends_with_pairs(order.inner)
        return possible and not undecided.any() and not self._parts.is_beside_a_short_one(w, order.end)

    def _values(self, w, sets, order):
        return EndValues(self._c, self._sides, self._parts, w, sets, order)

    @staticmethod
    def _by_values(values):
        """The verdict that the values give; None if the sides of the part at the end are possible."""
        if not values.solve():
            return Verdict.IMPOSSIBLE if values.contradicts_itself() else Verdict.UNKNOWN
        if values.vanished.impossible(values.base):
            return Verdict.IMPOSSIBLE
        return Verdict.UNKNOWN if values.vanished.misses() else None

    def _charge(self, w, sets, equal, order):
        """The descent per unit of a part at the end that changes nothing."""
        values = self._values(w, sets, replace(order, zero=sets.zero))
        found = self._by_lpec(sets, equal, values, [0.0]) if values.solve() else None
        return charge(found, values.extent, self._tolerances.descent)

    def _by_lpec(self, sets, equal, values, credits):
        """The LPEC in which the part at the end may grow at ``credits`` more for a unit; None where it is not known."""
        sets, radius = ActiveSets(values.zero, sets.gamma), self._tolerances.radius
        both = linearised_at_both(self._lpec, values.w, values.at_end, sets, radius, equal)
        if both is None:
            return None
        sets, equal, base, there = both
        joined = JoinedAtEnd(self._c, self._sides, self._parts, values, sets, equal)
        if not joined.applies(*joined.gradients(values.points)):
            return None
        base, limits = joined.with_end(base, there), values.limits(radius)
        limits, fixed, enough = [limits], [values.fixed], self._tolerances.descent
        return joined.searched(self._lpec, sets, base, values.points, credits, limits, fixed, enough)


class JoinedAtEnd(JoinedLpec):
    """Joins the model and the copy of the part beside an end, which holds what the part at the end held."""

    def __init__(self, c, sides, parts, values, sets, equal):
        order = values.order
        super().__init__(c, sides, parts, (values.copied,), order.inner if order.is_first else order.end, sets, equal)
        (self._copy,) = self.copies
        self._values, self._of_e = values, parts.of_variable == order.end
        self._rows_of_end = parts.of_row[self._program_rows] == order.end

    def with_end(self, base, other):
        """The LPEC with the rows and variables of the part at the end linearised at another point, from where it may only grow."""
        base = self._with_part(base, other, self._values.order.end)
        lower = base.program.lower.copy()
        lower[self._values.extent] = 0.0
        return replace(base, program=replace(base.program, lower=lower))

    def applies(self, before, here, _, held) -> bool:
        """Whether objective and shared rows are sums over the parts, and the copy contributes to the objective what e did."""
        rows, values = self._program_rows[self._shares], self._values
        # variables of no part may be factors of what e holds
        others = (self._parts.of_variable >= 0) & ~self._of_e
        (cost, A), (cost_here, A_here) = ((cost[others], A[rows][:, others]) for cost, A in (before, here))
        inside = ~np.isin(values.of_inner, [*values.ends, self._copy.extent])
        of_copy = held[0][values.of_inner[inside]]
        return agree(cost, cost_here) and agree(A.data, A_here.data) and agree(before[0][values.of_end[inside]], of_copy)

    def _joined(self, before, here, at_end, held):
        """Cost and rows of the model with the copy, of those at the points of ``values``."""
        (cost, A), (cost_here, A_here), (_, of_end), (cost_of_copy, of_copy) = before, here, at_end, held
        A, A_here, of_end = (some[self._program_rows] for some in (A, A_here, of_end))
        own, shared = sparse.diags(self._rows_of_end.astype(float)), sparse.diags(self._shares.astype(float))
        among = sparse.diags(self._of_e.astype(float))
        base = A + own @ (of_end - A) + shared @ (A_here - A) @ among
        base = self._with_columns(base, self._follows, self._passed_on)
        base = base + self._contributions(shared @ A, shared @ of_copy[self._program_rows])
        new = self._with_columns(of_copy[self._copy.rows], np.ones(len(self._copy.rows), dtype=bool), self._copy.columns)
        cut = base.shape[0] - self._last
        source = self._source
        of_copy = [cost[source[j]] if j in source and j in self._values.ends else cost_of_copy[j] for j in self._copy.own]
        cost = np.concatenate([np.where(self._of_e, cost_here, cost), of_copy])
        return cost, sparse.vstack([base[:cut], new, base[cut:]], format='csr')

    def _contributions(self, A, of_copy):
        """Entries of shared rows in the columns of the copy: those that e had, or that i has."""
        source = self._source
        entries = [A[:, source[j]] if j in source else of_copy[:, j] for j in self._copy.own]
        units = sparse.diags(np.where(self._copy.own == self._copy.extent, 1.0 / self._values.unit, 1.0))
        return sparse.hstack([sparse.csr_matrix((A.shape[0], self._n)), sparse.hstack(entries) @ units], format='csr')

    @cached_property
    def _source(self):
        """Variables of i -> those of e whose share in objective and rows the copy takes; e keeps that of the last time."""
        values = self._values
        ends = [] if values.order.is_first else values.ends
        return {j: k for j, k in zip(values.of_inner, values.of_end) if j not in ends}

    @property
    def _places_of_extents(self):
        return [self._values.extent]
