"""Branches: solved, certified, and left for better ones as long as the LPEC shows a way (theory, section 4).

The best point so far is ``Run.point``: an exactly complementary solution of its branch NLP with the certificate of the LPEC.
"""

from collections import Counter

import numpy as np

from pyomo_fesd.mpcc.active_set import G_ZERO, active_sets
from pyomo_fesd.mpcc.run import Outcome, Point, Stop
from pyomo_fesd.mpcc.search import leaves
from pyomo_fesd.mpcc.stationarity import Stationarity

#: A branch NLP's objective must fall by this, relative, to count as descent.
PROGRESS = 1e-8
#: Attempts at a branch NLP before it counts as infeasible; the iterations of the first and the second; and how many more where
#: they only lead to a feasible point (None: all that the solver has).
TRIES, EARLY, PATIENT = 2, 30, 100
MORE = {EARLY: PATIENT, PATIENT: None}
#: The trust region of a descent step shrinks by this, so often.
SHRINK, SHRINKS = 0.1, 3
#: Ipopt leaves sides without a multiplier at the root of its tolerance.  Those below this are taken for zero as well, where this
#: descends clearly: gradients, too, are that inexact.
NEARLY, CLEAR = 1e-4, 1e-4
#: More bi-active pairs than this say little of the branch, and an LPEC over them takes long.
SUGGESTED = 50
#: Trust region of the LPEC that looks for any feasible branch.
FAR = 1e3
#: A feasible point with variables beyond this and a negative objective has run away along an unbounded one; with a positive one
#: it only started where a relaxation had run away to.
UNBOUNDED = 1e15
#: A variable nearer to its lower bound than this is at it.
SHORT = 1e-6


class Branches:
    """The branches of one run.

    Parameters
    ----------
    compiled : Compiled
    steps : Steps
    tolerances : Tolerances
    gap : GapTest
        of the homotopy: a point far above what it promises is not worth a descent
    far_sighted : bool
        whether a full LPEC looks beyond the bi-active pairs for a better branch (option ``lpec='full'``)
    """

    def __init__(self, compiled, steps, tolerances, gap, far_sighted):
        self._c, self._steps, self._tolerances, self._gap = compiled, steps, tolerances, gap
        self._far_sighted, self.run, self._tried, self._solved = far_sighted, steps.run, Counter(), {}

    # what the algorithm calls

    def explore(self, relaxed, sets, final):
        """Solve the branch that active sets name, or if it has no solution, the one that an LPEC suggests; descend from it.

        Parameters
        ----------
        relaxed : NlpResult
            a relaxation's result, or the values to start at
        sets : ActiveSets
            at this point
        final : bool
            whether the homotopy ends here: no budget, and every descent is followed

        Returns
        -------
        float or None
            the objective of the branch that the sets name, if it has a certified solution
        """
        point = self._point(relaxed.w, sets.zero, relaxed, final)
        if point is None and 0 < np.count_nonzero(sets.gamma) <= SUGGESTED and self._c.has_objective:
            zero = self._steps.suggestion(relaxed.w, sets, self._tolerances.radius).zero
            point = self._point(relaxed.w, zero, relaxed, final)
        # the far-sighted do not wait: a point that the homotopy settles later is not solved again, nor looked from
        self._improve_from(point, final or self._far_sighted)
        return self._solved.get(sets.zero.tobytes())

    def explore_from(self, w, final):
        """Solve the branch that the values ``w`` name."""
        self._improve_from(self._point(w, active_sets(*self._sides(w), self._tolerances.biactive).zero, None, final), final)

    def move(self):
        """Look at the branches next to the incumbent that the model names, as long as one of them is better."""
        moves = list(self._c.moves)
        while moves:
            point, move = self.run.point, moves.pop(0)
            zero = self._beside(point, move)
            if zero is not None and not self.tried(zero):
                start = point.w.copy()
                start[move.starts] = move.at
                self._improve_from(self._point(start, zero, None, True), False)
                if self.run.point.f < point.f - PROGRESS * max(1.0, abs(point.f)):
                    moves = list(self._c.moves)

    def _beside(self, point, move):
        """The branch that a move leads to from ``point``; None if it is not worth a look."""
        if move.short.size and np.all(point.w[move.short] > self._c.lbx[move.short] + SHORT):
            return None
        sets = active_sets(*self._sides(point.w), self._tolerances.biactive)
        beside = sets.zero.copy()
        beside[move.ended] = G_ZERO
        beside[move.targets] = sets.zero[move.sources]
        # of a bi-active pair the point has both sides already
        return beside if np.any((beside != sets.zero) & ~sets.gamma) else None

    def search(self, *starts):
        """Look for any feasible branch: by the LPEC with every pair as a binary, and depth first over the pairs."""
        self.forget()
        # it would find branches in which collapsed elements hide what is wrong
        self._c.narrow()
        for w in starts:
            step = self._steps.suggestion(w, active_sets(*self._sides(w), np.inf), FAR)
            if step.solved and self._found(w + step.d, step.zero):
                return
        self._steps.note("search over the pairs", starts[-1])
        for w, zero in leaves(self._c, self._steps.branch, starts[-1], self._tolerances.feasibility):
            if self._found(w, zero):
                return

    def tried(self, zero):
        """Whether a branch has had its attempts."""
        return self._tried[zero.tobytes()] >= TRIES

    def forget(self):
        """Another path may make a branch succeed that failed before."""
        self._tried.clear()

    # how a point is found

    def _found(self, w, zero):
        self._improve_from(self._point(w, zero, None, True), True)
        return self.run.point is not None

    def _improve_from(self, point, final):
        """Keep ``point`` and what descends from it, while the homotopy does not promise something much better."""
        while point is not None:
            self._keep(point)
            point = self._descend(point, final or self._gap.closed(point.f))

    def _keep(self, point):
        """Keep the better of the incumbent and ``point``: certified before uncertified, then the lower objective."""
        best = self.run.point
        if best is None or (not point.certificate.certified, point.f) < (not best.certificate.certified, best.f):
            self.run.point = point

    def _descend(self, point, worth):
        """A better point, or None; what is not ``worth`` it is only asked whether its certificate holds."""
        size = max(1.0, abs(point.f))
        enough = point.f - PROGRESS * size
        if point.certificate.grade is Stationarity.DESCENT:
            return self._step_down(point, enough) if worth else None
        if point.certificate.grade is not Stationarity.B:
            return None
        better = self._look(point, enough, NEARLY, CLEAR * size)
        return self._look(point, enough, np.inf, 0.0) if better is None and worth and self._far_sighted else better

    def _step_down(self, point, enough):
        """In the branch of the certificate's direction: from its end, or within ever smaller trust regions."""
        step, w = point.certificate.lpec, point.w
        better = self._point(w + step.d, step.zero, None, False)
        radius = self._tolerances.radius
        sets = active_sets(*self._sides(w), self._tolerances.biactive)
        for _ in range(SHRINKS):
            if better is not None and better.f <= enough:
                return better
            radius *= SHRINK
            step = self._steps.lpec(w, sets, radius, point.equal)
            if not step.solved or step.value == 0.0:
                return None
            reach = radius * np.maximum(1.0, np.abs(w))
            better = self._certified(w + step.d, step.zero, box=(w - reach, w + reach), max_iter=EARLY)
        return better if better is not None and better.f <= enough else None

    def _look(self, point, enough, tolerance, clear):
        """In a branch that need not touch this point: where the LPEC leads if all sides below ``tolerance`` count as zero."""
        sets = active_sets(*self._sides(point.w), tolerance)
        if np.count_nonzero(sets.gamma) <= point.certificate.biactive:
            return None
        step = self._steps.lpec(point.w, sets, self._tolerances.radius, point.equal)
        better = self._point(point.w + step.d, step.zero, None, False) if step.solved and step.value < -clear else None
        return better if better is not None and better.f <= enough else None

    def _sides(self, w):
        at = self._c.evaluate(w)
        return at.G, at.H

    def _point(self, w, zero, duals, final):
        """The solution of branch ``zero``, certified; None if it has none.

        A branch that was solved is not solved again; one that failed gets another try, from a better point and without multipliers.
        """
        if self.tried(zero):
            return None
        key = zero.tobytes()
        self._tried[key] += 1
        again = self._tried[key] == TRIES
        budget = PATIENT if final or again else EARLY
        point = self._certified(w, zero, duals=None if again else duals, max_iter=budget)
        if point is None and final and duals is not None and not again:
            point = self._certified(w, zero, duals=None)
        if point is not None and point.certificate.grade is not Stationarity.DESCENT:
            self._tried[key], self._solved[key] = TRIES, point.f
        return point

    def _certified(self, w, zero, duals=None, **more):
        solved, equal = self._solve(w, zero, duals, **more)
        if solved is not None and not solved.solved and more.get('max_iter') in MORE:
            # feasible, so the branch has a solution, but not at its minimum yet
            solved, equal = self._solve(solved.w, zero, solved, **more | {'max_iter': MORE[more['max_iter']]})
        if solved is None:
            return None
        f = self._c.evaluate(solved.w).f
        if np.abs(solved.w).max(initial=0.0) > UNBOUNDED:
            if f < 0.0:
                raise Stop(Outcome.UNBOUNDED)
            return None
        certificate = self._steps.certify(solved, equal)
        if not certificate.feasible:
            return None
        return Point(solved, f, certificate, equal)

    def _solve(self, w, zero, duals, **more):
        """Two stages where pairs are to be decided (eq. 13): with the penalty to read eta, then with what eta decides."""
        c = self._c
        first = self._steps.branch(w, zero, None, 1.0, duals=duals, **more)
        if first is None or not c.eta.numel():
            return first, None
        equal = c.evaluate(first.w).eta > self._tolerances.eta
        second = self._steps.branch(first.w, zero, equal, 0.0, duals=first, **more)
        if second is None and c.tentative is not None and np.any(equal & c.tentative):
            equal = equal & ~c.tentative
            second = self._steps.branch(first.w, zero, equal, 0.0, duals=first, **more)
        return second, equal
