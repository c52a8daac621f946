"""Attempts at branches: one that was solved is not solved again; one that failed is tried once more.

Takes: values, and the zero sides of a branch.
Leaves: a certified ``Point``; None where the branch has no solution, or has had its attempts.
"""

from collections import Counter

import numpy as np

from pyomo_fesd.mpcc.algorithm.branch_solutions import ALMOST, FIRST, SECOND
from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.subproblems import Stationarity

#: Attempts at a branch NLP before it counts as infeasible.
TRIES = 2
#: Where rows contradict each other multipliers grow, those of what a branch keeps at 0 too: they show which of its changes is in
#: the wrong place.  A branch that leaves a violation below the first number is worth so many NLPs of neighbours, of those with a
#: pull above the last number.  (A hopper from start 9: 7.6 after 11 s; without them it ended at 11.5 after 153 s, not certified.)
NEARBY, REPAIRS, STRONG = 1e-4, 3, 1e2


class Attempts:
    """The attempts of one run.

    Parameters
    ----------
    solutions : BranchSolutions
    neighbours : Neighbours
    patient : bool
        whether the first attempt at a branch, too, has the iterations of the second one
    """

    def __init__(self, solutions, neighbours, patient):
        self._solutions, self._neighbours, self.patient = solutions, neighbours, patient
        self._number, self._objectives = Counter(), {}

    def point(self, w, zero, duals, final, most=NEARBY, **more):
        """The solution of branch ``zero``, or where it has none of one beside it, which its end shows; or None.

        That is one without the places of least extent that keep it from having a solution, or a neighbouring one that the
        multipliers of its end pull to, if that violates the rows by at most ``most``.
        """
        ways = (
            lambda: self._point(w, zero, duals, final, **more),
            lambda: self.without_short(zero, final, **more),
            lambda: self._pulled_to(zero, most, **more),
        )
        found = (way() for way in ways)
        return next((point for point in found if point is not None), None)

    def _pulled_to(self, zero, most, **more):
        """A solution of a neighbouring branch that the end of the failed branch ``zero`` pulls to; None without any."""
        end = self._solutions.failed(zero, most)
        others = [] if end is None else self._neighbours.pulling(end, STRONG)
        untried = [other for other in others if not self.tried(other)]
        found = (self._point(end.w, other, None, True, **more) for other in untried[:REPAIRS])
        return next((point for point in found if point is not None), None)

    def without_short(self, zero, final, **more):
        """A solution without places of least extent that kept the branch ``zero`` from having one; None without any."""
        end = self._solutions.failed(zero, ALMOST)
        others = [] if end is None else self._neighbours.with_fewer_short(Point(end, np.inf, None))
        found = (self._point(end.w, other, None, final, **more) for other in others)
        return next((point for point in found if point is not None), None)

    def _point(self, w, zero, duals, final, **more):
        """The solution of branch ``zero``, certified; None if it has none; a second attempt is without multipliers."""
        if self.tried(zero):
            return None
        key = zero.tobytes()
        # without multipliers and with all iterations a second attempt is no other one
        self._number[key] += TRIES if final and duals is None else 1
        last = self._number[key] >= TRIES
        duals = None if last else duals
        point = self._solutions.certified(w, zero, duals=duals, max_iter=SECOND if final or last else self.first, **more)
        if point is None and final and duals is not None:
            point = self._solutions.certified(w, zero, duals=None, **more)
        if point is not None and point.certificate.grade is not Stationarity.DESCENT:
            self._number[key], self._objectives[key] = TRIES, point.f
        return point

    @property
    def first(self) -> int:
        """The iterations of a first attempt."""
        return SECOND if self.patient else FIRST

    def objective(self, zero) -> float | None:
        """Return the objective of a branch with a solution that does not descend."""
        return self._objectives.get(zero.tobytes())

    def tried(self, zero) -> bool:
        """Return whether a branch has had its attempts."""
        return self._number[zero.tobytes()] >= TRIES

    def forget(self):
        """Reset the attempts: a branch that failed may succeed from another path."""
        self._number.clear()
