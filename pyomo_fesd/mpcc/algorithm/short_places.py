"""Places of least extent: better points without one, and points with fewer of them.

What such a place holds is as small as the tolerances: the LPEC does not see that only the bound keeps it, and orders of changes
beside it may not be known.

Takes: an incumbent.
Leaves: a better point, or a certified one with fewer such places; None if there is none.
"""

from functools import partial

from pyomo_fesd.mpcc.algorithm.branch_solutions import SECOND, as_good

#: Points with objectives as close as this, relative, are the same one, reached in other ways.
SAME = 1e-8


class ShortPlaces:
    """The places of least extent of one run.

    Parameters
    ----------
    branches : Branches
    """

    def __init__(self, branches):
        self._branches, self._solutions, self._neighbours = branches, branches.solutions, branches.neighbours
        self._tried, self._left_out = set(), []

    def are_at(self, point) -> bool:
        """Whether a variable of ``point`` is at its lower bound, so that there are branches for ``better``."""
        return next(self._neighbours.beside_short(point), None) is not None

    def better(self, point):
        """A better point in a neighbouring branch for a variable of ``point`` at its lower bound; None if there is none."""
        return next(self._branches.beside_short(point, point), None)

    def leave_out(self, point):
        """Do not return this point: its orders have been tried, and one of them may lead to the point that asks for another."""
        self._left_out.append(point.f)

    def is_left_out(self, f) -> bool:
        """Whether the orders of a point with this objective have been tried."""
        return any(abs(f - other) <= SAME * max(1.0, abs(f)) for other in self._left_out)

    def fewer(self, point):
        """A certified point in such a branch, or in one without any of them, with fewer variables at their lower bound; or None.

        The others are not evenly distributed beside a place of least extent, and the objective has the error of that: the point
        counts if it is ``as_good``.  Solutions that are known come first, also without such places beside one without them; each of
        them, and each branch, is tried once.
        """
        return self._fewer(point, as_good(point, self._branches.run.lowest))

    def _fewer(self, point, enough):
        number = self._neighbours.number_of_short(point.w)
        known = next(self._solutions.up_to(enough, partial(self._is_new_with_fewer, max(number, 1))), None)
        return self._beside(point, enough, number) if known is None else known

    def _is_new_with_fewer(self, number, f, w):
        """Whether a point is not left out, and has fewer variables at their lower bound than a ``number``."""
        return not self.is_left_out(f) and self._neighbours.number_of_short(w) < number

    def _beside(self, point, enough, number):
        """A certified point with less than a ``number`` of these variables, in a branch beside ``point``."""
        for zero in self._neighbours.with_fewer_short(point):
            if zero.tobytes() in self._tried:
                continue
            self._tried.add(zero.tobytes())
            solved = self._solutions.certified(point.w, zero, max_iter=SECOND, below=enough, enough=enough)
            if solved is None or not solved.certificate.certified:
                continue
            end = self._branches.improve_from(solved, True)
            if end.certificate.certified and self._is_new_with_fewer(number, end.f, end.w):
                return end
        return None
