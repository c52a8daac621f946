"""Solutions that are more even: the method's own variables, free in a solution, are shared evenly.

A variable with guide bounds may end far above them in a certified solution: a long piece, which is resolved badly.  The values of
the pairs stay as they are in their order; either the caller shares the variables evenly at once (``Setup.even``), or neighbouring
branches lead there, one after the other.

Takes: a certified incumbent.
Leaves: a certified one that is more even, or better.
"""

import numpy as np

from pyomo_fesd.mpcc.algorithm.branch_solutions import AS_GOOD, SECOND, one_of
from pyomo_fesd.mpcc.algorithm.descents import PROGRESS, is_below
from pyomo_fesd.mpcc.algorithm.neighbours import AT_BOUND

#: A point is more even than another if its deviations are smaller by this part.
EVENER = 1e-3
#: NLP iterations in search of more even points: this part of those before, and at least so many.
SHARE, LEAST = 0.1, 300


class Evenness:
    """The evenness of one run's incumbent.

    Parameters
    ----------
    subsolves : Subsolves
    branches : Branches
    even : callable or None
        see ``Setup``
    """

    def __init__(self, subsolves, branches, even):
        self._c, self._tolerances, self.run = subsolves.compiled, subsolves.tolerances, subsolves.run
        self._subsolves, self._branches, self._even, self._known = subsolves, branches, even, []

    def improve(self):
        """From a certified incumbent with variables above their guide bounds, go to branches where they are lower."""
        point, tried = self.run.point, set()
        if point is None or not point.certificate.certified or not self._is_uneven(point.w) or self._is_known(point):
            return
        self._known.append(point)
        evened = self._evened(point)
        if evened is not None:
            self.run.point = evened
            return
        before = self.run.counts.iterations
        most = before + max(SHARE * before, LEAST)
        while point is not None:
            self.run.point = point
            point = self._neighbour(point, tried, most)

    def _is_known(self, point):
        """Whether more even points than this one were sought before: an order of theirs may lead back to it."""
        return one_of(self._known, point, self._subsolves.parts.motion) is not None

    def _is_uneven(self, w):
        c = self._c
        return bool((w[c.guided] > c.guide_ubx[c.guided] + AT_BOUND).any())

    def _evened(self, point):
        """The solution near the point that the caller makes of this one; None if there is none that is more even."""
        start = None if self._even is None else self._even(point.w)
        if start is None:
            return None
        self._subsolves.note("shared evenly", start)
        return self._if_more_even(start, self._subsolves.sets(start, self._tolerances.biactive).zero, point, np.inf)

    def _neighbour(self, point, tried, most):
        """A certified solution of a neighbouring branch that is more even, unless the run has had ``most`` iterations before.

        Small variables are the first to change sides.
        """
        candidates = [n for n in self._c.neighbours if n.short.size]
        enough = point.less(PROGRESS)
        for neighbour in sorted(candidates, key=lambda n: point.w[n.short].max()):
            zero = self._branches.neighbours.zero_sides(point, neighbour, always=True)
            if zero is None or zero.tobytes() in tried:
                continue
            if self.run.counts.iterations >= most:
                return None
            tried.add(zero.tobytes())
            found = self._if_more_even(point.w, zero, point, enough)
            if found is not None:
                return found
        return None

    def _if_more_even(self, start, zero, point, worth):
        """The certified solution that the branch ``zero`` leads to from ``start``, if it is more even than ``point``, or better.

        An objective may depend on the method's own variables: then its least lies in a branch further on.  The descent goes there
        from a solution that is not above ``worth``.
        """
        size = max(1.0, abs(point.f))
        found = self._branches.solutions.certified(start, zero, max_iter=SECOND, below=point.f)
        if not is_below(found, point.f + AS_GOOD * size):
            return None
        found = self._descended(found) if found.f <= worth else found
        is_more_even = self._unevenness(found.w) < self._unevenness(point.w) * (1 - EVENER)
        is_better = is_more_even or is_below(found, point.f - PROGRESS * size)
        return found if found.certificate.certified and is_better else None

    def _descended(self, point):
        """The end of the descent from ``point``."""
        end = point
        while point is not None:
            end, point = point, self._branches.descents.better(point, True)
        return end

    def _unevenness(self, w):
        c, guided = self._c, self._c.guided
        return float(((w[guided] - (c.guide_lbx[guided] + c.guide_ubx[guided]) / 2) ** 2).sum())
