"""Neighbouring branches of a point: which there are, and their zero sides.

Takes: the ``neighbours`` of a compiled MPCC, and a point.
Leaves: zero sides; nothing is solved (``branches``).
"""

from collections.abc import Iterator

import numpy as np

from pyomo_fesd.mpcc.algorithm.moves import differs, with_moves
from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.subproblems import ActiveSets

#: A variable nearer to its lower bound than this is at it.
AT_BOUND = 1e-6


class Neighbours:
    """The neighbouring branches of one run.

    Parameters
    ----------
    subsolves : Subsolves

    Attributes
    ----------
    all : list of NeighbourIndices
    """

    def __init__(self, subsolves):
        self._c, self._subsolves, self._biactive = subsolves.compiled, subsolves, subsolves.tolerances.biactive
        self.all = self._c.neighbours

    def zero_sides(self, point, *neighbours, always=False, wide=False, settles=False):
        """The zero sides of neighbouring branches of ``point``, one after the other; None if they need not be tried.

        Parameters
        ----------
        always : bool
            whether also where no variable is at its lower bound, although they ask for that
        wide : bool
            whether all moves, also where nothing changes
        settles : bool
            whether a branch of the point counts too, in which bi-active pairs have other sides than these now have
        """
        if not (always or all(self._is_one_of(point, neighbour) for neighbour in neighbours)):
            return None
        sets = self._subsolves.sets(point.w, self._biactive)
        zero = sets.zero
        for neighbour in neighbours:
            now = ActiveSets(zero, sets.gamma)
            changes = [change for change in neighbour.changes if wide or differs(change, now)]
            zero = with_moves(zero, [change.moved(neighbour.later) for change in changes])
        # the point lies on both sides of a bi-active pair already
        return zero if np.any((zero != sets.zero) & (settles | ~sets.gamma)) else None

    def _is_one_of(self, point, neighbour):
        """Whether a neighbouring branch is one of this point: a variable is at its lower bound, if it asks for that."""
        short = neighbour.short
        return not short.size or bool(np.any(point.w[short] <= self._c.lbx[short] + AT_BOUND))

    def pull(self, nlp, zero) -> float:
        """Return how strongly the end of a branch NLP pulls towards the neighbouring branch ``zero``.

        This is the sum of the multipliers by which variables that its own branch keeps at a bound, and the other one does not,
        would leave it: how much the objective falls, to first order, as each grows by 1.  Without a solution it is the violation
        that they would reduce.  It is infinite where the point is the end of no NLP, or its multipliers are no numbers.
        """
        own = self._subsolves.held(nlp.w, self._subsolves.sets(nlp.w, self._biactive).zero)
        released = np.flatnonzero((own != 0) & (self._subsolves.held(nlp.w, zero) == 0))
        if len(nlp.lam_x) < len(own) or not np.isfinite(nlp.lam_x[released]).all():
            return np.inf
        return float(np.maximum(own[released] * nlp.lam_x[released], 0.0).sum())

    def pulling(self, nlp, least) -> list[np.ndarray]:
        """Return the zero sides of the neighbouring branches that the end of a branch NLP pulls to, the strongest pull first."""
        point = Point(nlp, np.inf, None)
        sides = (self.zero_sides(point, neighbour, always=True) for neighbour in self.all)
        found = [(self.pull(nlp, zero), zero) for zero in sides if zero is not None]
        return [zero for pull, zero in sorted(found, key=lambda one: -one[0]) if pull > least]

    def number_of_short(self, w) -> int:
        """Return how many variables are at their lower bound, of those for which there are neighbouring branches."""
        short = np.unique(np.concatenate([neighbour.short for neighbour in self.all], dtype=int)) if self.all else []
        return int(np.count_nonzero(w[short] <= self._c.lbx[short] + AT_BOUND))

    def beside_short(self, point) -> Iterator[np.ndarray]:
        """Yield the zero sides of the neighbouring branches for each variable at its lower bound."""
        sides = (self.zero_sides(point, neighbour) for neighbour in self.all if neighbour.short.size)
        return (zero for zero in sides if zero is not None)

    def without_all_short(self, point) -> list[list]:
        """Return neighbours that together leave out all variables at their lower bound, in two ways; none for a single one."""
        short = [neighbour for neighbour in self.all if neighbour.short.size and self._is_one_of(point, neighbour)]
        # a place of least extent takes over what one of the two beside it holds
        by_first = {neighbour.short.tobytes(): neighbour for neighbour in reversed(short)}
        by_last = {neighbour.short.tobytes(): neighbour for neighbour in short}
        return [list(reversed(some.values())) for some in (by_first, by_last)] if len(by_last) > 1 else []

    def with_fewer_short(self, point) -> Iterator[np.ndarray]:
        """Yield the zero sides of the neighbouring branches without all variables at their lower bound, then without each one.

        What such a place holds may be bi-active: only where all of it moves does the place beside it take over.
        """
        each = [[neighbour] for neighbour in self.all if neighbour.short.size]
        for wide in (False, True):
            for some in (*self.without_all_short(point), *each):
                zero = self.zero_sides(point, *some, wide=wide, settles=wide)
                if zero is not None:
                    yield zero
