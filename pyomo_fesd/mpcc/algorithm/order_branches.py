"""The branches of an order of coinciding changes: the incumbent is solved once more in them, with a spare place of extent zero.

If the linearised problem of such a branch descends, the place grows and leads to a better point; if it does not, the order is
settled.

Takes: the incumbent and the ways of an ``Order``.
Leaves: a better point, or the outcome of the order.
"""

from functools import partial

import numpy as np

from pyomo_fesd.mpcc.algorithm.branch_solutions import AS_GOOD, SECOND, as_good, have_same_values
from pyomo_fesd.mpcc.algorithm.descents import PROGRESS
from pyomo_fesd.mpcc.algorithm.orders import NEAR_BOUND
from pyomo_fesd.mpcc.algorithm.subsolves import INFEASIBLE
from pyomo_fesd.mpcc.subproblems import ActiveSets, Stationarity

#: Iterations enough to show that there is no branch of an order.
PATIENCE = 300
#: Outcomes of an order: it leads to no better point; that could not be shown; or no branch on this grid contains the incumbent.
SETTLED, OPEN, ABSENT = 'settled', 'open', 'absent'


class OrderBranches:
    """The branches of orders in one run.

    Parameters
    ----------
    subsolves : Subsolves
    branches : Branches
    """

    def __init__(self, subsolves, branches):
        self._c, self._tolerances, self._subsolves, self._branches = subsolves.compiled, subsolves.tolerances, subsolves, branches
        # whether they are first solved with places of no extent, as this has led on where places as they are did not
        self._from_none = False

    def search(self, point, ways, inserts, may_grow):
        """A better point in the branches of some ways, or their outcome; the search that has led on last comes first."""
        better = self.grown(point, ways) if may_grow and not self._from_none else None
        if better is not None:
            return better
        found = self._first(partial(self._try, point, inserts), ways)
        if not isinstance(found, str):
            self._from_none = may_grow
        elif may_grow and self._from_none:
            better = self.grown(point, ways)
            self._from_none = better is None
        return found if better is None else better

    def grown(self, point, ways):
        """The first better point in the branches of some ways, from their places as they are; or None.

        Where places have no extent, what they hold is not determined, and an NLP with them at 0 may not end at all.
        """
        for way in ways:
            start = way.start.copy()
            start[way.extents] = point.w[way.extents]
            found = self._better(point, (start,), way.zero, way.extents)
            if found is not OPEN:
                return found
        return None

    @staticmethod
    def _first(attempt, ways):
        """The first outcome of equivalent ways that is not open."""
        return next((found for found in (attempt(way) for way in ways) if found is not OPEN), OPEN)

    def _try(self, point, inserts, way):
        """A better point in the branch of a way, in which its places may grow; or the outcome.

        ``inserts`` is whether places can be inserted, so that their values have a limit.
        """
        with self._c.vanishing(way.extents):
            found = self._without_extent(point, inserts, way)
        return found if isinstance(found, str) else self._better(point, *found, way.extents)

    def _without_extent(self, point, inserts, way):
        """The outcome of a way whose places have no extent; or starts and zero sides of a branch that may be better."""
        start, equal = self._beside(point, way)
        if start in (ABSENT, OPEN):
            return start
        if self._is_another(point, start):
            # it does not show where the order leads, but it may be better
            return (start.w,), way.zero
        gamma = np.zeros(len(way.zero), dtype=bool)
        gamma[way.either] = self._subsolves.sets(start.w, self._tolerances.biactive).gamma[way.either]
        sets = ActiveSets(self._subsolves.settled(start.w, way.zero), gamma)
        w = self._subsolves.at_limit(start.w, sets.zero, way.extents, point.w[way.extents].max())
        if w is None and inserts:
            return OPEN
        w, enough = start.w if w is None else w, self._tolerances.descent
        step = self._subsolves.lpec(w, sets, self._tolerances.radius, equal, multipliers=-start.lam_g, enough=enough)
        if not step.solved:
            return OPEN
        return SETTLED if step.descent <= enough else ((w + step.d, w), step.zero)

    def _beside(self, point, way):
        """The incumbent in the branch of a way, its places without extent, and the decisions in force; or the outcome."""
        start, zero, most = way.start.copy(), way.zero, np.full(len(point.w), np.inf)
        start[way.extents] = most[way.extents] = 0.0
        more = {'box': (-most, most), 'max_iter': PATIENCE}
        more['box'][0][way.extents] = 0.0
        apart = self._decides(point.w, way.extents)
        if self._branches.solutions.at_once:
            found = self._beside_with_decisions(start, zero, apart, **more)
            if found is not None:
                return found
        first = self._subsolves.attempt(start, zero, None, 1.0, **more)
        if first is None or first.status in INFEASIBLE:
            # without a place to spare the branch lacks another change of the incumbent, which shows nothing about the order
            return ABSENT if way.spares else OPEN, None
        if first.solved and self._c.evaluate(first.w).f > point.f + AS_GOOD * max(1.0, abs(point.f)):
            return OPEN, None
        solved, equal = self._branches.solutions.decided(first, zero, apart=apart, **more) if first.solved else (None, None)
        if first.solved and (solved is None or not solved.solved):
            # without decisions there is more room: an order that does not descend then does not descend with them
            solved, equal = self._subsolves.attempt(first.w, zero, None, 0.0, **more), np.zeros_like(apart)
        return (solved, equal) if solved is not None and solved.solved else (OPEN, None)

    def _beside_with_decisions(self, start, zero, apart, **more):
        """``_beside`` with the decisions that the sides of the branch ask for; None where it may have a solution without them."""
        asked = self._subsolves.asked(start, zero)
        if asked is None:
            return None
        equal = asked & ~apart
        solved = self._subsolves.attempt(start, zero, equal, 0.0, **more)
        if solved is None or solved.status in INFEASIBLE:
            return None
        return (solved, equal) if solved.solved else (OPEN, None)

    def _leads_back(self, found, extents, even, point):
        """Whether places of an order have least extent in the solution of its branch, and without these it is ``point`` again.

        Then they do not grow: no descent is left beside that solution, but for one that makes them even smaller, and what it gains
        is the error of the places beside them.
        """
        stays = found.certificate.certified or found.certificate.grade is Stationarity.LIMITED
        are_short = bool(np.all(found.w[extents] <= self._c.lbx[extents] + NEAR_BOUND))
        alone = self._branches.neighbours.number_of_short(found.w) == len(extents)
        return stays and are_short and alone and have_same_values(even, point, self._subsolves.parts.motion)

    def _is_another(self, point, other):
        """Whether another solution does not meet the incumbent: its places are not the same."""
        return abs(self._c.evaluate(other.w).f - point.f) > AS_GOOD * max(1.0, abs(point.f))

    def _decides(self, w, variables):
        """The decisions that involve variables: beside a place of extent zero nothing is decided, as changes lie on both sides."""
        return (self._c.gradients(w)[-1][:, variables].toarray() != 0.0).any(axis=1)

    def _better(self, point, starts, zero, extents):
        """A point in the branch ``zero``, in which the places ``extents`` may grow, that is better than the incumbent; or OPEN.

        SETTLED where the solution of the branch leads back to the incumbent.
        """
        enough = point.less(PROGRESS)
        most = as_good(point, None) if self._branches.solutions.at_once else point.f
        for start in starts:
            found = self._branches.solutions.certified(start, zero, max_iter=SECOND, below=most)
            even = None if found is None else self._branches.without_short(found)
            if even is not None and even.f <= enough:
                return even
            if even is not None and self._leads_back(found, extents, even, point):
                return SETTLED
            if found is not None and found.f <= enough:
                return found
        return OPEN
