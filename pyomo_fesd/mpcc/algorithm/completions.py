"""Rounds of relaxation, completion and branch, for problems in which a relaxation rarely names a branch that has a solution.

Reg(eps) finds good values of the free variables, but where many pairs change sides at once its active sets are those of no branch.
A completion keeps the free variables of a relaxation and solves the equations and pairs for all others: an exactly complementary
point, which names its branch.  From the solution of this branch NLP the next relaxation starts.  First eps falls as in the
homotopy; then relaxations around the best point lead to better ones, until they no longer do (theory, section 4).
"""

import time
from dataclasses import replace

import numpy as np

from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.algorithm.subsolves import INFEASIBLE
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.mpcc.subproblems import Stationarity

#: Smallest eps of a relaxation that is worth a completion, and the eps of those around the best point.
LAST, AROUND = 1e-3, (1e-1, 1e-2)
#: Times that relaxations go around the best point at most, and the part by which its objective must fall to go on.
CYCLES, PROGRESS = 6, 1e-3
#: First eps of a second path, relative to that of the first; it is followed where the relaxations around the best point have an
#: objective that is smaller by the second part, or the first path went astray: the third part of its relaxations did not reach
#: their solutions, or one was infeasible.
LOOSER, GAP, ASTRAY = 10.0, 0.5, 0.5
#: Part of the time limit after which no further round begins: the best point is certified in the rest.
SHARE = 0.6
#: A completion may take this many times as long as the relaxation before, and at least these seconds.
LONGER, LEAST_TIME = 2.0, 2.0
#: Branch NLPs from one relaxation: one that stops on its way has better values of the free variables, but perhaps the wrong branch.
ATTEMPTS = 2
#: Two relaxations with objectives as close as this, relative, have the same solution.
SAME = 1e-8
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
        self._form = 'scholtes' if self._options.relaxation == 'auto' else self._options.relaxation
        self._deadline, self._promise, self._possible = setup.deadline.part(SHARE), -np.inf, False
        self._objectives, self._around = [], set()

    def follow(self, start):
        """Run all rounds from ``start``; the best point, certified if it can be, is in the run."""
        for eps in (self._options.eps_init, self._options.eps_init * LOOSER):
            is_astray = self._down(start, eps)
            self._improve()
            if not self._possible or not (is_astray or self._promising()) or self._deadline.expired():
                break
        if self.run.point is not None:
            self._certify()

    def _down(self, w, eps):
        """Rounds with ever smaller eps, each from the relaxation before; returns whether they went astray.

        That is, if many did not reach their solutions, or one ended as infeasible.  The points of a relaxation with a smaller eps
        are among those of one before: after an infeasible one there is none.
        """
        solved = []
        while eps * ROUND_OFF >= max(LAST, self._options.eps_final) and not self._deadline.expired():
            relaxed = self._round(w, eps)
            solved.append(relaxed.solved)
            if relaxed.status in INFEASIBLE:
                return True
            w = relaxed.w
            eps *= self._options.eps_factor
        return solved.count(False) >= ASTRAY * len(solved)

    def _improve(self):
        """Rounds around the best point, until they no longer find a much better one."""
        for _ in range(CYCLES):
            before = self.run.point
            if before is None:
                return
            for eps in AROUND:
                if self._deadline.expired():
                    return
                self._round_about(self.run.point.w, eps)
            if not self.run.point.f < before.f - PROGRESS * max(1.0, abs(before.f)):
                return

    def _round_about(self, w, eps):
        """A round from ``w``, unless it was run before: it starts cold, and would have the same end."""
        key = eps, w.tobytes(), self._c.lbx.tobytes()
        if key not in self._around:
            self._around.add(key)
            self._round(w, eps)

    def _promising(self):
        """Whether the relaxations promise a much better point than the best one."""
        point = self.run.point
        return point is None or point.f - self._promise > GAP * abs(point.f)

    def _round(self, w, eps):
        """One relaxation from ``w``, and the branch of its completion, unless it is known; returns the relaxation's result."""
        self.run.eps = eps
        began = time.perf_counter()
        relaxed = self._subsolves.relax(self._form, w, eps, None, self._options.relaxation_iterations)
        self._subsolves.keep_least_infeasible(relaxed.w)
        if eps <= AROUND[0] * ROUND_OFF and self._subsolves.usable(relaxed):
            self._promise = self._c.evaluate(relaxed.w).f
        if not self._is_known(relaxed):
            self._explore(relaxed.w, max(LEAST_TIME, LONGER * (time.perf_counter() - began)))
        self._after(self.run)
        return relaxed

    def _is_known(self, relaxed):
        """Whether a relaxation before had the same solution."""
        f = self._c.evaluate(relaxed.w).f
        is_known = relaxed.solved and any(abs(f - other) <= SAME * abs(f) for other in self._objectives)
        self._objectives += [f] if relaxed.solved else []
        return is_known

    def _explore(self, w, seconds):
        """Solve the branch of the completion of ``w`` without guide bounds."""
        narrow = self._c.widen()
        try:
            self._branch_of_completion(w, seconds)
        finally:
            if narrow:
                self._c.narrow()

    def _branch_of_completion(self, w, seconds):
        """Solve the branch that the completion of ``w`` names; where that stops on its way, the completion of its end once more."""
        for _ in range(ATTEMPTS):
            completed, is_complete, note = self._complete(w, seconds)
            self._subsolves.note(note, completed)
            self._possible = self._possible or is_complete
            if is_complete:
                self._keep(NlpResult(completed, self._c.evaluate(completed).f, 'given', 0, np.zeros(0), np.zeros(0)))
            result, equal = self._branches.solutions.beside(completed)
            if result is not None and self._subsolves.usable(result):
                self._keep(result, equal)
            if result is None or not result.stopped:
                return
            w = result.w

    def _keep(self, solved, equal=None):
        """Keep a feasible point that is better than the best so far; its certificate comes at the end."""
        f, best = self._c.evaluate(solved.w).f, self.run.point
        if best is not None and f >= best.f:
            return
        certificate = self._subsolves.measure(solved.w)
        if certificate.feasible:
            self.run.point = Point(solved, f, replace(certificate, grade=Stationarity.UNTRIED), equal)

    def _certify(self):
        """The certificate of the best point, and descent from it."""
        best = self.run.point
        self._c.widen()
        if best.equal is None:
            # no NLP's solution: it is judged as it is, and its branch may have a better one
            self.run.point = replace(best, certificate=self._subsolves.judge(best.w))
            self._branches.explore_from(best.w, True)
        else:
            self.run.point = replace(best, certificate=self._subsolves.certify(best.nlp, best.equal))
            self._branches.improve_from(self.run.point, True)
