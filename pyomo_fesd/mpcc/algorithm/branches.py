"""Branches: solved, certified, and left for better ones as long as the LPEC finds a direction (theory, section 4).

The best point so far is ``Run.point``: an exactly complementary solution of its branch NLP with the certificate of the LPEC.
"""

from collections import Counter, deque
from dataclasses import replace
from itertools import chain

import numpy as np

from pyomo_fesd.mpcc.algorithm.branch_solutions import FIRST, SECOND, UNEVEN, BranchSolutions, as_good
from pyomo_fesd.mpcc.algorithm.neighbours import Neighbours
from pyomo_fesd.mpcc.algorithm.search import FEW, Verdict, exhaust, leaves
from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.subproblems import MATTERS, Stationarity

#: A branch NLP's objective must fall by this, relative, to count as descent.
PROGRESS = 1e-8
#: So much in a neighbouring branch, where a place of least extent gives a little less to each one that takes it over.
WORTH = 1e-6
#: So much from a point whose branch NLP did not end: smaller steps only go on in a branch that Ipopt cannot finish.
UNFINISHED = 1e-3
#: Attempts at a branch NLP before it counts as infeasible.
TRIES = 2
#: The trust region of a descent step shrinks by this factor, so many times; once where a branch was followed onward from the point
#: before (of ten such searches of discs, 3 to 5 s each, none has led down).
SHRINK, SHRINKS = 0.1, {False: 3, True: 1}
#: It grows by the first number from one within which the objective has fallen by the second, relative.
GROWTH, FALL = 3.0, 1e-3
#: Ipopt leaves sides without a multiplier at the root of its tolerance.  Those below this count as zero as well, if this descends
#: clearly: gradients are inexact too.
NEARLY, CLEAR = 1e-4, 1e-4
#: HiGHS for an LPEC with a binary for every pair, which proves nothing: small descents and a long search are not worth it.
WIDE = {'mip_abs_gap': 1e-6, 'mip_max_nodes': 100}
#: With more bi-active pairs than this an LPEC takes long and tells little about the branch.
SUGGESTED = 50
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
    """

    def __init__(self, subsolves, gap, global_lpec, patient=False):
        self._c, self._tolerances, self.run = subsolves.compiled, subsolves.tolerances, subsolves.run
        self._subsolves, self._gap, self._global_lpec = subsolves, gap, global_lpec
        self._attempts, self._solved, self._exhausted = Counter(), {}, {}
        self._patient = patient
        self.solutions, self.neighbours = BranchSolutions(subsolves, at_once=patient), Neighbours(subsolves)

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
        point = self._point(relaxed.w, sets.zero, relaxed, final)
        if point is None and 0 < np.count_nonzero(sets.gamma) <= SUGGESTED and self._c.has_objective:
            step = self._subsolves.suggestion(relaxed.w, sets, self._tolerances.radius)
            if step.solved:
                # undecided sides may be written in several ways
                point = self._point(relaxed.w, self._subsolves.settled(relaxed.w, step.zero), relaxed, final)
        # with the global LPEC search for better branches now: this point is not revisited
        self.improve_from(point, final or self._global_lpec)
        return self._solved.get(sets.zero.tobytes())

    def explore_nearby(self, relaxed, sets):
        """Solve the branch that active sets name where Newton's method does, and keep its solution if it is certified.

        This is no attempt at the branch: without a certified solution the path goes on as if nothing had been tried.
        """
        if self.tried(sets.zero):
            return
        point = self.solutions.certified(relaxed.w, sets.zero, duals=relaxed, nearby=True)
        if point is not None and point.certificate.certified:
            self.improve_from(point, False)

    def explore_from(self, w, final):
        """Solve the branch that the values ``w`` name."""
        self.improve_from(self._point(w, self._subsolves.sets(w, self._tolerances.biactive).zero, None, final), final)

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
        if zero is None or self.tried(zero):
            return
        start = point.w.copy()
        for neighbour in neighbours:
            start[neighbour.starts] = neighbour.at
        self._widen_from(self.improve_from(self._point(start, zero, None, True, below=point.f), False))

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
        return self.run.point.f < before.f - part * max(1.0, abs(before.f))

    def _widen_from(self, end):
        """Go on from a point below the incumbent that only bounds of the method keep from descending.

        First without guide bounds; then, with decisions of sides, in branches without its variables at their lower bound.
        """
        if end is None or end.certificate.grade is not Stationarity.LIMITED:
            return
        incumbent = self.run.point
        enough = incumbent.f - PROGRESS * max(1.0, abs(incumbent.f))
        if not is_below(end, enough):
            return
        if self._c.widen():
            self._release(end)
        elif self.solutions.at_once:
            self._pass_bounds(end, enough)

    def _pass_bounds(self, end, enough):
        """Go on in the branches without the variables of ``end`` at their lower bound until the incumbent is better."""
        incumbent = self.run.point
        for zero in self.neighbours.beside_short(end):
            self.improve_from(self.solutions.certified(end.w, zero, max_iter=SECOND, below=incumbent.f, enough=enough), True)
            if self._is_progress(incumbent, PROGRESS):
                return

    def release(self):
        """Go on from the incumbent, which guide bounds kept from descending, after these have been widened."""
        self._release(self.run.point)

    def _release(self, point):
        zero = self._subsolves.sets(point.w, self._tolerances.biactive).zero
        released = self.solutions.certified(point.w, zero, max_iter=SECOND)
        self.improve_from(self._without_narrow(zero, True) if released is None else released, True)

    def search(self, *starts):
        """Search for any feasible branch: by the LPEC with every pair as a binary, then depth first over the pairs."""
        self.forget()
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

    def tried(self, zero):
        """Whether a branch has had its attempts."""
        return self._attempts[zero.tobytes()] >= TRIES

    def be_patient(self) -> bool:
        """From now on give a first attempt the iterations of the second one; returns whether it had fewer."""
        had_fewer, self._patient = not self._patient, True
        return had_fewer

    @property
    def _first(self):
        """The iterations of a first attempt."""
        return SECOND if self._patient else FIRST

    def forget(self):
        """Reset the attempts: a branch that failed may succeed from another path."""
        self._attempts.clear()

    # how a point is found

    def _found(self, w, zero):
        self.improve_from(self._point(w, zero, None, True), True)
        return self.run.point is not None

    def improve_from(self, point, final):
        """Keep ``point`` and the points that descend from it, unless the homotopy promises something much better.

        Returns the last of them.
        """
        end = None
        while point is not None:
            self._keep(point)
            end, point = point, self.descend(point, final or self._gap.closed(point.f))
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

    def descend(self, point, worth):
        """A better point, or None; a point that is not ``worth`` a descent only gets the check of its certificate."""
        size = max(1.0, abs(point.f))
        enough = point.f - (PROGRESS if point.nlp.solved else UNFINISHED) * size
        if point.certificate.grade is Stationarity.DESCENT:
            return self._step_down(point, enough) if worth else None
        if point.certificate.grade is not Stationarity.B:
            return None
        better = self._beyond(point, enough, NEARLY, CLEAR) or self._within_round_off(point)
        return self._beyond(point, enough, np.inf, 0.0, WIDE) if better is None and worth and self._global_lpec else better

    def _within_round_off(self, point):
        """A clearly better point in the branch of a direction whose descent matters, though it proves nothing."""
        step = point.certificate.lpec
        if step is None or not step.matters:
            return None
        # with an objective of 0 any other point would be as good
        enough = point.f - MATTERS * max(abs(point.f), -step.value)
        found = (self.solutions.certified(w, step.zero, max_iter=SECOND, below=point.f) for w in (point.w + step.d, point.w))
        return next((better for better in found if is_below(better, enough)), None)

    def _step_down(self, point, enough):
        """In the branch of the direction: from its end, or onward from the point, or within ever smaller trust regions."""
        step = point.certificate.lpec
        if point.reach is not None and self.solutions.at_once:
            better = self._within_reach(point, enough, (GROWTH * point.reach, point.reach))
            if better is not None:
                return better
        better = self._point(point.w + step.d, step.zero, None, False)
        if is_below(better, enough) or _settles(better, point):
            return better
        # from the end of a direction Ipopt may go back; from the point itself it follows it, if slowly
        follows = self._patient and point.equal is not None
        onward = self.solutions.onward(point, step.zero, enough) if follows else None
        radii = (self._tolerances.radius * SHRINK**k for k in range(1, 1 + SHRINKS[follows]))
        return self._within_reach(point, enough, radii) if onward is None else onward

    def _within_reach(self, point, enough, radii):
        """In the branch of the best direction within a trust region, of which the radii are tried until one leads down.

        With decisions of sides small steps are not worth it where the incumbent is certified.
        """
        w, incumbent = point.w, self.run.point
        if self.solutions.at_once and incumbent is not None and incumbent.certificate.certified:
            enough = min(enough, point.f - UNEVEN * max(1.0, abs(point.f)))
        sets = self._subsolves.sets(w, self._tolerances.biactive)
        for radius in radii:
            step = self._subsolves.lpec(w, sets, radius, point.equal, limits=self._subsolves.patience())
            if not step.solved or step.descent == 0.0:
                return None
            reach = radius * np.maximum(1.0, np.abs(w))
            within = {'box': (w - reach, w + reach), 'max_iter': self._first}
            better = self.solutions.certified(w + step.d, step.zero, below=point.f, **within)
            if is_below(better, enough) or _settles(better, point):
                return replace(better, reach=radius if is_below(better, point.f - FALL * max(1.0, abs(point.f))) else None)
        return None

    def _beyond(self, point, enough, tolerance, clear, limits=None):
        """A better point in the branch that the LPEC names if all sides below ``tolerance`` count as zero."""
        sets = self._subsolves.sets(point.w, tolerance)
        if np.count_nonzero(sets.gamma) <= point.certificate.biactive:
            return None
        limits = self._subsolves.patience() | (limits or {})
        # where the multipliers of the point show that no side descends, there is nothing to search for
        shown = {'multipliers': -point.nlp.lam_g, 'enough': clear}
        step = self._subsolves.lpec(point.w, sets, self._tolerances.radius, point.equal, limits=limits, **shown)
        if not step.solved or step.descent <= clear:
            return None
        return self._point(point.w + step.d, step.zero, None, False, enough=enough)

    def _point(self, w, zero, duals, final, **more):
        """The solution of branch ``zero``, or of one without the places of least extent that keep it from having one; or None."""
        point = self._solution(w, zero, duals, final, **more)
        return self._without_narrow(zero, final, **more) if point is None else point

    def _without_narrow(self, zero, final, **more):
        """A solution without places of least extent that kept the branch ``zero`` from having one; None without any."""
        end = self.solutions.narrow(zero)
        others = [] if end is None else self.neighbours.with_fewer_short(Point(end, np.inf, None))
        found = (self._solution(end.w, other, None, final, **more) for other in others)
        return next((point for point in found if point is not None), None)

    def _solution(self, w, zero, duals, final, **more):
        """The solution of branch ``zero``, certified; None if it has none.

        A branch that was solved is not solved again; one that failed is tried once more, without multipliers.
        """
        if self.tried(zero):
            return None
        key = zero.tobytes()
        # without multipliers and with all iterations a second attempt is no other one
        self._attempts[key] += TRIES if final and duals is None else 1
        last = self._attempts[key] >= TRIES
        duals = None if last else duals
        point = self.solutions.certified(w, zero, duals=duals, max_iter=SECOND if final or last else self._first, **more)
        if point is None and final and duals is not None:
            point = self.solutions.certified(w, zero, duals=None, **more)
        if point is not None and point.certificate.grade is not Stationarity.DESCENT:
            self._attempts[key], self._solved[key] = TRIES, point.f
        return point


def _settles(better, point):
    """Whether another point is certified and as good, where the descent of this one is too small to count as progress."""
    return better is not None and better.certificate.certified and better.f <= point.f


def is_below(point, enough) -> bool:
    """Return whether there is a point and its objective is at most ``enough``."""
    return point is not None and point.f <= enough
