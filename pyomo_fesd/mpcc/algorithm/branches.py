"""Branches: solved, certified, and left for better ones as long as the LPEC finds a direction (theory, section 4).

The best point so far is ``Run.point``: an exactly complementary solution of its branch NLP with the certificate of the LPEC.
"""

from collections import deque
from itertools import chain

import numpy as np

from pyomo_fesd.mpcc.algorithm.attempts import Attempts
from pyomo_fesd.mpcc.algorithm.branch_solutions import FIRST, SECOND, UNEVEN, BranchSolutions, as_good
from pyomo_fesd.mpcc.algorithm.descents import PROGRESS, Descents, is_below
from pyomo_fesd.mpcc.algorithm.neighbours import Neighbours
from pyomo_fesd.mpcc.algorithm.search import FEW, Verdict, exhaust, leaves
from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.subproblems import Stationarity

#: The objective must fall by this, relative, in a neighbouring branch to count as descent: a place of least extent gives a little
#: to each one that takes it over.
WORTH = 1e-6
#: With more bi-active pairs than this an LPEC takes long and tells little about the branch.
SUGGESTED = 50
#: A pull to a neighbouring branch below this, relative to the objective, is not worth an NLP: of 79 neighbours of three hoppers 13
#: with a pull of at least 1 were better, and of 27 below this one was, by 3e-5.
WEAK = 0.1
#: Neighbours of a branch that a relaxation names, and that leaves a violation below this, are worth more than the next relaxation.
#: (Not those of branches with an objective near the relaxation's only: from start 5 a branch of a hopper that ends at 16.8, where
#: the relaxation is at 7.8, has a neighbour at 7.1.)
FAR = 1.0
#: Trust region of the LPEC that searches for any feasible branch.
SEARCH_RADIUS = 1e3


class Branches:
    """The branches of one run.

    Parameters
    ----------
    subsolves : Subsolves
    gap : GapTest
        of the homotopy: a point far above the objective that it promises is not worth a descent
    global_lpec : bool
        whether a full LPEC searches beyond the bi-active pairs for a better branch (option ``lpec='full'``)
    patient : bool
        whether the first attempt at a branch, too, has the iterations of the second one: where points can be completed, branches
        are worth more than further relaxations

    Attributes
    ----------
    solutions : BranchSolutions
    neighbours : Neighbours
    attempts : Attempts
    descents : Descents
    """

    def __init__(self, subsolves, gap, global_lpec, patient=False):
        self._c, self._tolerances, self.run = subsolves.compiled, subsolves.tolerances, subsolves.run
        self._subsolves, self._gap, self._global_lpec = subsolves, gap, global_lpec
        self.solutions, self.neighbours, self._exhausted = BranchSolutions(subsolves, at_once=patient), Neighbours(subsolves), {}
        self.attempts = Attempts(self.solutions, self.neighbours, patient)
        self.descents = Descents(subsolves, self.attempts, self.solutions, global_lpec)

    # called by the algorithm

    def explore(self, relaxed, sets, final):
        """Solve the branch that active sets name, or if it has no solution, the one that an LPEC suggests; descend from it.

        Parameters
        ----------
        relaxed : NlpResult
            a relaxation's result
        sets : ActiveSets
            at this point
        final : bool
            whether the homotopy ends here: no iteration limit, and every descent is followed

        Returns
        -------
        float or None
            the objective of the branch that the sets name, if it has a certified solution
        """
        point = self.attempts.point(relaxed.w, sets.zero, relaxed, final, most=FAR)
        if point is None and 0 < np.count_nonzero(sets.gamma) <= SUGGESTED and self._c.has_objective:
            step = self._subsolves.suggestion(relaxed.w, sets, self._tolerances.radius)
            if step.solved:
                # undecided sides may be written in several ways
                point = self.attempts.point(relaxed.w, self._subsolves.settled(relaxed.w, step.zero), relaxed, final)
        # with the global LPEC search for better branches now: this point is not revisited
        self.improve_from(point, final or self._global_lpec)
        return self.attempts.objective(sets.zero)

    def explore_nearby(self, relaxed, sets):
        """Solve the branch that active sets name where Newton's method does, and keep its solution if it is certified.

        This is no attempt at the branch: without a certified solution the path goes on as if nothing had been tried.
        """
        if self.attempts.tried(sets.zero):
            return
        point = self.solutions.certified(relaxed.w, sets.zero, duals=relaxed, nearby=True)
        if point is not None and point.certificate.certified:
            self.improve_from(point, False)

    def explore_from(self, w, final):
        """Solve the branch that the values ``w`` name."""
        self.improve_from(self.attempts.point(w, self._subsolves.sets(w, self._tolerances.biactive).zero, None, final), final)

    def explore_decided(self, w) -> bool:
        """Solve the branch that ``w`` names with the decisions that ``w`` asks for (eq. 13); return whether that settles it.

        It does where the solution is certified and asks for the same decisions: then the NLP that finds eta would change nothing.
        """
        if not self._c.eta.numel():
            return False
        zero = self._subsolves.sets(w, self._tolerances.biactive).zero
        result, equal = self.solutions.imposed(w, zero, True, self._subsolves.branch, max_iter=FIRST)
        if result is None or not result.solved or np.any((self._c.evaluate(result.w).eta > self._tolerances.eta) != equal):
            return False
        certificate = self._subsolves.certify(result, equal)
        if certificate.certified:
            self.improve_from(Point(result, self._c.evaluate(result.w).f, certificate, equal), False)
        return certificate.certified

    def take_certified(self):
        """Make the best certified solution found the incumbent, if that is not certified and the solution is ``as_good``.

        Those without variables at their lower bound come first: where there are any, orders of changes may stay open.
        """
        best = self.run.point
        if best is not None and not best.certificate.certified:
            enough, number = as_good(best, self.run.lowest), self.neighbours.number_of_short
            known = chain(self.solutions.up_to(enough, lambda f, w: not number(w)), self.solutions.up_to(enough))
            self.run.point = next(known, best)

    def try_neighbours(self):
        """Solve the neighbouring branches of the incumbent, and those of each better point found, until none of them is better.

        Changes move.  If no certified point is found so, everything else in their places moves too, whatever it means.
        """
        self._try_without_all_short()
        self._try_each()
        if not self.run.point.certificate.certified:
            self._try_each(wide=True)

    def _try_each(self, wide=False):
        neighbours = deque(self.neighbours.all)
        left = len(neighbours)
        while left:
            point, neighbour = self.run.point, neighbours[0]
            neighbours.rotate(-1)
            left -= 1
            self._try(point, neighbour, wide=wide)
            if self._is_progress(point, WORTH):
                left = len(neighbours)

    def _try_without_all_short(self):
        """Solve the branches without any of the variables at their lower bound: one by one each would gain next to nothing."""
        while True:
            point = self.run.point
            for some in self.neighbours.without_all_short(point):
                self._try(point, *some)
            if not self._is_progress(point, PROGRESS):
                return

    def _try(self, point, *neighbours, wide=False):
        """Solve the branch of neighbours of a point, one after the other, unless it was tried, and go on from a better solution."""
        zero = self.neighbours.zero_sides(point, *neighbours, wide=wide)
        if zero is None or self.attempts.tried(zero) or not (wide or self._pulls(point, zero)):
            return
        start = point.w.copy()
        for neighbour in neighbours:
            start[neighbour.starts] = neighbour.at
        self._widen_from(self.improve_from(self.attempts.point(start, zero, None, True, below=point.f), False))

    def _pulls(self, point, zero):
        """Whether a neighbouring branch is worth its NLP: the incumbent is not certified, or its multipliers pull there."""
        return not point.certificate.certified or self.neighbours.pull(point.nlp, zero) >= WEAK * abs(point.f)

    def without_short(self, point):
        """A certified solution without places of least extent beside a point that has some; None if there is none.

        It may cost a little more (``as_good``): the places beside one of least extent are large, and the objective has their error.
        Only where branches are solved with the decisions of their sides (``BranchSolutions.at_once``): others have even places.
        """
        if not self.solutions.at_once or not self.neighbours.number_of_short(point.w):
            return None
        enough = as_good(point, None)
        for zero in self.neighbours.with_fewer_short(point):
            found = self.solutions.certified(point.w, zero, max_iter=SECOND, below=enough, enough=enough)
            if found is not None and found.certificate.certified and not self.neighbours.number_of_short(found.w):
                return found
        return None

    def _is_progress(self, before, part):
        """Whether the incumbent is better than a point ``before`` by this relative part."""
        return self.run.point.f < before.less(part)

    def _widen_from(self, end):
        """Go on from a point below the incumbent that only bounds of the method keep from descending.

        First without guide bounds; then, with decisions of sides, in branches without its variables at their lower bound.
        """
        if end is None or end.certificate.grade is not Stationarity.LIMITED:
            return
        if not is_below(end, self.run.point.less(PROGRESS)):
            return
        if self._c.widen():
            self._release(end)
        elif self.solutions.at_once:
            self._pass_bounds(end)

    def _pass_bounds(self, end):
        """Go on in the branches without the variables of ``end`` at their lower bound until the incumbent is better."""
        incumbent = self.run.point
        for found in self.beside_short(end, incumbent):
            self.improve_from(found, True)
            if self._is_progress(incumbent, PROGRESS):
                return

    def beside_short(self, point, worse):
        """Yield solutions, better than a ``worse`` point, of the branches without variables of ``point`` at their lower bound."""
        more = {'max_iter': SECOND, 'below': worse.f, 'enough': worse.less(PROGRESS)}
        found = (self.solutions.certified(point.w, zero, **more) for zero in self.neighbours.beside_short(point))
        return (other for other in found if other is not None)

    def release(self):
        """Go on from the incumbent, which guide bounds kept from descending, after these have been widened."""
        self._release(self.run.point)

    def _release(self, point):
        zero = self._subsolves.sets(point.w, self._tolerances.biactive).zero
        released = self.solutions.certified(point.w, zero, max_iter=SECOND)
        self.improve_from(self.attempts.without_short(zero, True) if released is None else released, True)

    def search(self, *starts):
        """Search for any feasible branch: by the LPEC with every pair as a binary, then depth first over the pairs."""
        self.attempts.forget()
        # within the guide bounds, as degenerate branches beyond them would hide the contradiction
        self._c.narrow()
        for w in starts:
            step = self._subsolves.suggestion(w, self._subsolves.sets(w, np.inf), SEARCH_RADIUS)
            if step.solved and self._found(w + step.d, step.zero):
                return
        self._subsolves.note("search over the pairs", starts[-1])
        for w, zero in leaves(self._c, self._subsolves.branch, starts[-1], self._tolerances.feasibility):
            if self._found(w, zero):
                return

    def exhaust(self, w):
        """The ``Verdict`` of an exhaustive search from ``w``, of a problem with few pairs and without guide bounds."""
        if self._c.guided.any():
            return Verdict.OPEN
        key = w.tobytes()
        if key not in self._exhausted:
            if self._c.G.numel() <= FEW:
                self._subsolves.note("search over the pairs", w)
            self._exhausted[key] = exhaust(self._c, self._subsolves.node, w)
        return self._exhausted[key]

    # how a point is found

    def _found(self, w, zero):
        self.improve_from(self.attempts.point(w, zero, None, True), True)
        return self.run.point is not None

    def improve_from(self, point, final):
        """Keep ``point`` and the points that descend from it, unless the homotopy promises something much better.

        Returns the last of them.
        """
        end = None
        while point is not None:
            self._keep(point)
            end, point = point, self.descents.better(point, final or self._gap.closed(point.f))
        return end

    def _keep(self, point):
        """Keep the better of the incumbent and ``point``: certified before uncertified, then the lower objective."""
        best = self.run.point
        if best is None or self._rank(point) < self._rank(best):
            self.run.point = point
        if self.run.lowest is None or point.f < self.run.lowest.f:
            self.run.lowest = point

    def _rank(self, point):
        """Certified points come first, then those of lower objective; places of least extent are charged for their error."""
        error = UNEVEN * max(1.0, abs(point.f)) if self.solutions.at_once and self.neighbours.number_of_short(point.w) else 0.0
        return not point.certificate.certified, point.f + error
