"""Rounds of relaxation, completion and branch, for problems in which a relaxation rarely names a branch that has a solution.

Reg(eps) finds good values of the free variables, but where many pairs change sides at once its active sets are those of no branch.
A completion keeps the free variables of a relaxation and solves the equations and pairs for all others: an exactly complementary
point, which names its branch.  From the solution of this branch NLP the next relaxation starts.  First eps falls as in the
homotopy; then relaxations around the best point lead to better ones, until they no longer do (theory, section 4).
"""

import time
from dataclasses import replace

import numpy as np

from pyomo_fesd.mpcc.algorithm.branch_solutions import SECOND, as_good
from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.algorithm.subsolves import INFEASIBLE
from pyomo_fesd.mpcc.nlp import Fall, NlpResult
from pyomo_fesd.mpcc.subproblems import Stationarity

#: Smallest eps of a relaxation that is worth a completion, and the eps of those around the best point.
LAST, AROUND = 1e-3, (1e-1, 1e-2)
#: Part of ``relaxation_iterations`` that the first relaxation may use, and all others after one that has not reached its solution:
#: then most do not, and the completion of a point on the way is as good.
BUDGET = 0.4
#: It goes on while the objective falls by a fifth in 50 iterations: discs from three starts were at 1,130 to 1,360 after 200, and
#: two of these at 218 and 238 after 300.  With 300 for all relaxations they took longer.
FALL = Fall(0.2, 50, 2.0)
#: Times that relaxations go around the best point at most, and the part by which its objective must fall to go on: more than the
#: error of uneven elements.
CYCLES, PROGRESS = 6, 2e-2
#: option ``relaxation`` -> paths: the form of their relaxations, and their first eps relative to the option ``eps_init``.  Bounds
#: of products may lead to a local minimum of the violation, and penalties to where nothing touches: each form finds what the other
#: one misses.
PATHS = {'auto': (('scholtes', 1.0), ('elastic', 1.0))}
LOOSER = (1.0, 10.0)
#: option ``relaxation`` -> one more path, where relaxations still promise as much after all of these: which points the rounds find
#: depends on round-off (a ball ended at 239 where relaxations promised 13, and at 28 with this path).
FURTHER = {'auto': ('elastic', 10.0)}
#: A further path is followed where the relaxations around the best point have an objective that is smaller by this part, or one of
#: the path before was infeasible.
GAP = 0.5
#: With more than this part of the pairs undecided a relaxation names no branch.
UNDECIDED = 0.5
#: Part of the time limit after which no further round begins: the best point is certified in the rest.
SHARE = 0.6
#: A completion may take this many times as long as the relaxation before, and at least these seconds: twice what one of a ball's
#: took with three jobs on two cores, as the load of the machine should not decide which points are found.
LONGER, LEAST_TIME = 2.0, 10.0
#: Branch NLPs from one relaxation: one that stops on its way has better values of the free variables, but perhaps the wrong branch.
#: Each has the iterations of a second attempt: few that take more end solved.
ATTEMPTS = 2
#: Two relaxations with objectives as close as this, relative, have the same solution; and so have two branches, whose bi-active
#: pairs may have either side.
SAME, SAME_BRANCH = 1e-8, 1e-5
#: Products of eps carry round-off.
ROUND_OFF = 1.001


class Completions:
    """The rounds of one run.

    Parameters
    ----------
    setup : Setup
        with ``complete``
    subsolves : Subsolves
    branches : Branches
    """

    def __init__(self, setup, subsolves, branches):
        self._c, self._options, self._complete, self._after = setup.compiled, setup.options, setup.complete, setup.after
        self._subsolves, self._branches, self.run = subsolves, branches, subsolves.run
        form = self._options.relaxation
        self._paths, self._further = PATHS.get(form) or tuple((form, looser) for looser in LOOSER), FURTHER.get(form)
        self._form, self._share, self._all_end = self._paths[0][0], BUDGET, True
        self._deadline, self._possible = setup.deadline.part(SHARE), False
        # objectives of the last relaxation that holds, or before there is one, that was not infeasible; and of the last one
        self._promise, self._keeps_promise, self._last = -np.inf, False, np.inf
        self._objectives, self._around, self._left = [], set(), None
        # the best points of the path, and of all solutions
        self._best = self._solved = None

    def follow(self, start):
        """Run all rounds from ``start``; the best point, certified if it can be, is in the run."""
        for form, looser in self._paths:
            is_last = (form, looser) == self._paths[-1]
            leads_away = False if self._goes_around(form) else self._follow(form, start, self._options.eps_init * looser, is_last)
            if not (self._possible or leads_away) or not self._promising() or self._deadline.expired():
                break
        if self._left is not None and self._possible and self._is_far_below(self._last):
            self._follow(*self._left, True)
        if self._possible and self._promising():
            self._follow_further(start)
        if self.run.point is not None:
            self._certify(self.run.point)

    def further(self, start) -> bool:
        """Follow one more path from ``start``, and certify its best point; returns whether there is one worth it."""
        incumbent, self._solved = self.run.point, None
        if not self._possible or self._deadline.expired() or not self._follow_further(start):
            return False
        if self._best is None or self._best.f - incumbent.f > GAP * abs(self._best.f):
            self.run.point = incumbent
            return False
        self._certify(self._best)
        return True

    def _follow_further(self, start):
        """Follow the further path, once; returns whether it was left."""
        if self._further is None:
            return False
        (form, looser), self._further = self._further, None
        self._follow(form, start, self._options.eps_init * looser, True)
        return True

    def _goes_around(self, form):
        """Rounds of another form around the best point of a path that was left; returns whether they lead on.

        From the start such relaxations may not reach their solutions either (those of discs do not).
        """
        before = self._best
        if self._left is None or before is None:
            return False
        self._form = form
        self._improve()
        return self._best_is_below(before)

    def _follow(self, form, w, eps, is_last):
        """Follow one path from ``w``; return whether it leads away from all solutions."""
        self._form, self._best = form, None
        leads_away = self._down(w, eps, is_last)
        if is_last or not leads_away or not self._promising():
            self._improve()
        return leads_away

    def _down(self, w, eps, is_last_path=True):
        """Rounds with ever smaller eps, each from the relaxation before.

        They end where two in a row lead to the same branch: those around its solution lead on from it.  Returns whether the path
        leads away from all solutions, so that the next one has more to go on from: a relaxation is infeasible (the points of one
        with a smaller eps are among those of one before), or already the first does not reach its solution.
        """
        least, before, may_lead_away = max(LAST, self._options.eps_final), None, not is_last_path
        while eps * ROUND_OFF >= least and not self._deadline.expired():
            is_last = eps * self._options.eps_factor * ROUND_OFF < least
            relaxed, end = self._round(w, eps, is_on_the_way=not is_last)
            if may_lead_away and relaxed.stopped:
                self._left = self._form, relaxed.w, eps * self._options.eps_factor
                return True
            if relaxed.status in INFEASIBLE:
                return True
            if None not in (before, end) and abs(end - before) <= SAME_BRANCH * abs(before):
                return False
            w, before, may_lead_away = relaxed.w, end, False
            eps *= self._options.eps_factor
        return False

    def _improve(self):
        """Rounds around the best point of the path, until they no longer find a much better one."""
        for _ in range(CYCLES):
            before = self._best
            if before is None:
                return
            self._cycle()
            if not self._best_is_below(before):
                return

    def _best_is_below(self, before):
        return self._best.f < before.less(PROGRESS)

    def _cycle(self):
        """A round for each eps from the best point; and one on from the first relaxation, where all of these only promise more."""
        before, first = self._best, None
        for eps in AROUND:
            relaxed = self._round_about(self._best.w, eps)
            first = first or relaxed
        if first is not None and self._best is before and self._is_far_below(self._last):
            self._round_about(first.w, AROUND[-1])

    def _round_about(self, w, eps):
        """The relaxation of a round from ``w``; None after the deadline, and if it was run before.

        It starts cold, and would have the same end.
        """
        key = self._form, eps, w.tobytes(), self._c.lbx.tobytes()
        if key in self._around or self._deadline.expired():
            return None
        self._around.add(key)
        return self._round(w, eps)[0]

    def _promising(self):
        """Whether the relaxations promise a much better point than the best one."""
        return self._is_far_below(self._promise)

    def _is_far_below(self, f):
        """Whether an objective is much lower than that of the best point, or there is none."""
        point = self.run.point
        return point is None or point.f - f > GAP * abs(point.f)

    def _names_a_branch(self, relaxed):
        """Whether a relaxation itself names a branch: it is not infeasible, and most of its pairs are decided."""
        undecided = np.count_nonzero(self._subsolves.sets(relaxed.w, self._subsolves.biactive(self._c.evaluate(relaxed.w))).gamma)
        return relaxed.status not in INFEASIBLE and undecided <= UNDECIDED * self._c.pairs

    def _round(self, w, eps, is_on_the_way=False):
        """One relaxation from ``w``, and the branch of its completion, unless it is known.

        Returns the relaxation's result, and the objective of the branch, None without one.
        Where a completion stops on its way, the other sides are those of the relaxation: on the way to smaller eps it is only worth
        a branch if it names one.
        """
        self.run.eps, end = eps, None
        began = time.perf_counter()
        budget = int(self._share * self._options.relaxation_iterations)
        relaxed = self._subsolves.relax(self._form, w, eps, None, budget, FALL)
        self._all_end = self._all_end and not relaxed.stopped
        self._share = 1.0 if self._all_end else BUDGET
        self._subsolves.keep_least_infeasible(relaxed.w)
        if eps <= AROUND[0] * ROUND_OFF:
            self._last = self._c.evaluate(relaxed.w).f
            holds = self._subsolves.usable(relaxed)
            if holds or not (self._keeps_promise or relaxed.status in INFEASIBLE):
                self._promise, self._keeps_promise = self._last, holds
        if not self._is_known(relaxed):
            seconds = max(LEAST_TIME, LONGER * (time.perf_counter() - began))
            end = self._explore(relaxed.w, seconds, is_on_the_way and not self._names_a_branch(relaxed))
        self._after(self.run)
        return relaxed, end

    def _is_known(self, relaxed):
        """Whether a relaxation before had the same solution."""
        f = self._c.evaluate(relaxed.w).f
        is_known = relaxed.solved and any(abs(f - other) <= SAME * abs(f) for other in self._objectives)
        self._objectives += [f] if relaxed.solved else []
        return is_known

    def _explore(self, w, seconds, to_the_end):
        """Solve the branch of the completion of ``w`` without guide bounds; returns its objective."""
        narrow = self._c.widen()
        try:
            return self._branch_of_completion(w, seconds, to_the_end)
        finally:
            if narrow:
                self._c.narrow()

    def _branch_of_completion(self, w, seconds, to_the_end=False):
        """Solve the branch that the completion of ``w`` names; where that stops on its way, the completion of its end once more.

        With ``to_the_end`` only one that is complete names a branch.  Returns the objective, None without a solution.
        """
        end = None
        for _ in range(ATTEMPTS):
            completed, is_complete = self._subsolves.completed(self._complete, w, seconds)
            self._possible = self._possible or is_complete
            if to_the_end and not is_complete:
                break
            if is_complete:
                self._keep(NlpResult(completed, self._c.evaluate(completed).f, 'given', 0, np.zeros(0), np.zeros(0)))
            result, equal = self._branches.solutions.beside(completed, max_iter=SECOND)
            if result is not None and self._subsolves.usable(result):
                self._keep(result, equal)
                end = self._c.evaluate(result.w).f
            if result is None or not result.stopped:
                break
            w = result.w
        return end

    def _keep(self, solved, equal=None):
        """Keep a feasible point that is better than the best of the path, or of all; its certificate comes at the end."""
        certificate = self._subsolves.measure(solved.w)
        if not certificate.feasible:
            return
        point = Point(solved, self._c.evaluate(solved.w).f, replace(certificate, grade=Stationarity.UNTRIED), equal)
        self._best, self.run.point = (_lower(best, point) for best in (self._best, self.run.point))
        if solved.solved:
            self._solved = _lower(self._solved, point)

    def _certify(self, best):
        """The certificate of the best point, and descent from it; where it is not certified, from the best solution of an NLP.

        Where an NLP was stopped the constraints hold, but nothing may lead on from there.
        """
        solved = self._solved
        self._c.widen()
        if best.equal is None:
            # no NLP's solution: it is judged as it is, and its branch may have a better one
            self.run.point = replace(best, certificate=self._subsolves.judge(best.w))
            self._branches.explore_from(best.w, True)
        else:
            even = self._branches.without_short(best) or self._simulated_again(best)
            if even is not None:
                even = self._branches.without_short(even) or even
                self.run.point = even
                self._branches.improve_from(even, True)
                return
            self.run.point = self._judged(best)
            self._branches.improve_from(self.run.point, True)
        if solved is not None and solved is not best and not self.run.point.certificate.certified:
            self._branches.improve_from(self._judged(solved), True)

    def _simulated_again(self, point):
        """The certified solution of the branch that the controls of a point with places of least extent lead to; None without one.

        A change that such a place keeps on one side of an end may happen on the other side of it.
        """
        if not self._branches.neighbours.number_of_short(point.w):
            return None
        completed, is_complete = self._subsolves.completed(self._complete, point.w, LEAST_TIME)
        if not is_complete:
            return None
        zero, enough = self._subsolves.sets(completed, self._subsolves.tolerances.biactive).zero, as_good(point, None)
        found = self._branches.solutions.certified(completed, zero, max_iter=SECOND, below=enough, enough=enough)
        return found if found is not None and found.certificate.certified else None

    def _judged(self, point):
        """A point with its certificate."""
        return replace(point, certificate=self._subsolves.certify(point.nlp, point.equal))


def _lower(best, point):
    """The one of lower objective; ``best`` may be None."""
    return point if best is None or point.f < best.f else best
