"""The hybrid active-set algorithm (theory, section 4): Reg(eps) -> active sets -> branch NLP -> certificate.

``Homotopy`` follows Reg(eps); the branches that it names give exactly complementary points, which the LPEC certifies or from which
it descends into better branches (``Branches``).
"""

from dataclasses import replace

import numpy as np

from pyomo_fesd.core import DeferredInterrupt, interrupt_handled
from pyomo_fesd.mpcc.algorithm.branches import Branches
from pyomo_fesd.mpcc.algorithm.coincidences import Coincidences
from pyomo_fesd.mpcc.algorithm.completions import Completions
from pyomo_fesd.mpcc.algorithm.descents import PROGRESS, is_below
from pyomo_fesd.mpcc.algorithm.evenness import Evenness
from pyomo_fesd.mpcc.algorithm.feasible_start import feasible_start
from pyomo_fesd.mpcc.algorithm.gap_test import GapTest
from pyomo_fesd.mpcc.algorithm.homotopy import Homotopy
from pyomo_fesd.mpcc.algorithm.search import Verdict
from pyomo_fesd.mpcc.algorithm.start_points import start_point
from pyomo_fesd.mpcc.algorithm.state import Outcome, Point, Run, Setup, Stop, Tolerances
from pyomo_fesd.mpcc.algorithm.subsolves import Subsolves
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.mpcc.subproblems import Stationarity

#: Part of the time limit after which a homotopy without a feasible point pauses for a further start.
PATIENCE = 0.5
#: Other starts of a problem with few pairs, before it is called infeasible.
RESTARTS = 3
#: Value of the option ``warm_start`` with which the run ends at the branch of the start values.
ONLY = 'only'
#: Times that a better order of changes is made even again.
ROUNDS = 3


def few_pairs(compiled) -> bool:
    """Whether a problem is so small that a thorough search costs little."""
    return len(compiled.side_of) // 2 <= 50


#: option ``lpec`` -> whether a full LPEC, cheap with few pairs, searches for better branches
GLOBAL_LPEC_SEARCH = {
    'auto': few_pairs,
    'full': lambda compiled: True,
    'reduced': lambda compiled: False,
}


class HybridSolver:
    """Runs the algorithm on a compiled MPCC; ``run`` grows while it does."""

    def __init__(self, setup: Setup):
        self._setup, self._c, self._options, self.run = setup, setup.compiled, setup.options, Run()
        self._subsolves = Subsolves(setup, Tolerances.of(self._options), self.run)
        self._gap = GapTest(self._options.gap_tol * 1e-2, self._options.gap_tol)
        search = GLOBAL_LPEC_SEARCH[self._options.lpec](self._c)
        patient = setup.complete is not None or bool(self._c.impacts)
        self._branches = Branches(self._subsolves, self._gap, search, patient)
        self._evenness = Evenness(self._subsolves, self._branches, setup.even)
        self._coincidences = Coincidences(self._subsolves, self._branches)
        completes = setup.complete is not None and self._c.has_objective
        self._completions = Completions(setup, self._subsolves, self._branches) if completes else None

    def solve(self) -> Run:
        """Run until a point is certified, nothing is left to try, or a limit is reached."""
        run = self.run
        if not self._options.warm_start:
            # beyond the guide bounds there are more, and unwanted, solutions; the path widens them if it finds none within
            self._c.narrow()
        try:
            with DeferredInterrupt() as interrupt, interrupt.raising():
                run.outcome = MODES[self._options.mode](self)
        except Stop as stop:
            run.outcome = stop.outcome
        except KeyboardInterrupt:
            interrupt_handled()
            run.outcome = Outcome.INTERRUPTED
        finally:
            self._c.widen()
        if run.point is not None:
            self._take_lowest()
        self._coincidences.mark_untried()
        if run.point is None and self._options.mode == 'hybrid':
            run.point = self._feasible_without_branch()
            if run.point is not None and run.outcome is Outcome.INFEASIBLE:
                run.outcome = Outcome.FEASIBLE
        if run.point is not None:
            run.w = run.point.w
        return run

    def certify(self):
        """The certificate of the start values, every order of changes that fall together tried."""
        certificate = self._subsolves.judge(self._c.x0)
        return self._coincidences.checked(self._c.x0, certificate) if certificate.certified else certificate

    def _hybrid(self):
        """The whole algorithm."""
        if self._starts_at_a_solution():
            return Outcome.SOLVED
        if self._options.warm_start and self._from_values():
            self._finish()
        if not self._is_certified():
            if self._options.warm_start == ONLY:
                return Outcome.NO_BRANCH if self.run.point is None else Outcome.FEASIBLE
            self._from_start()
            self._finish()
            self._try_neighbours_at_last()
            self._try_further_at_last()
            self._try_lowest_at_last()
        if self.run.point is None:
            return Outcome.INFEASIBLE
        if not self._is_certified():
            return Outcome.FEASIBLE
        return Outcome.CERTIFIED if self._c.has_objective else Outcome.SOLVED

    def _is_certified(self):
        return self.run.point is not None and self.run.point.certificate.certified

    def _from_start(self):
        """Completions or the homotopy; without a feasible point from there, a search.

        From a certified end of completions orders of changes lead on, and neighbouring branches only where these stay open.
        """
        if self._complete():
            self._branches.take_certified()
            if self._is_certified():
                return
        else:
            self._follow_path()
        if self.run.point is not None and self._c.has_objective:
            self._branches.try_neighbours()
        if self.run.point is None:
            self._search_everywhere()

    def _finish(self):
        """Descend, and try all orders of changes, before the point counts."""
        self._c.widen()
        self._descend_at_last()
        self._branches.take_certified()
        self._settle()

    def _try_neighbours_at_last(self):
        """Go on from a neighbouring branch where the point is not certified in the end."""
        before = self.run.point
        if before is None or before.certificate.certified or not self._c.has_objective:
            return
        self._branches.try_neighbours()
        if self.run.point is not before:
            self._finish()

    def _try_lowest_at_last(self):
        """Go on from the lowest point, with patience, where the incumbent is not certified in the end.

        A certified point with orders of changes that stay open has replaced lower ones, of which none counts less than it does now.
        """
        point = self.run.point
        if point is None or point.certificate.certified or not self._c.has_objective:
            return
        had_less = not self._branches.attempts.patient and point.certificate.grade is Stationarity.DESCENT
        self._branches.attempts.patient = True
        if self._take_lowest() or had_less:
            self._finish()
        if self._certify_at_last():
            self._finish()
        self._try_neighbours_at_last()

    def _try_further_at_last(self):
        """Follow one more path where the incumbent is not certified in the end."""
        if self._completions is None or self._is_certified():
            return
        self._branches.attempts.forget()
        if self._completions.further(self._c.x0):
            self._finish()
            self._try_neighbours_at_last()

    def _certify_at_last(self) -> bool:
        """Certify the incumbent in all the time that is left, where its LPEC was stopped early; return whether it was."""
        point = self.run.point
        if point is None or point.certificate.grade is not Stationarity.UNSOLVED or not point.nlp.solved:
            return False
        certificate = self._subsolves.certify(point.nlp, point.equal, at_last=True)
        self.run.point = replace(point, certificate=certificate)
        return True

    def _take_lowest(self):
        """Make the lowest point the incumbent, if that is not certified and clearly above; returns whether it was."""
        point, lowest = self.run.point, self.run.lowest
        if lowest is None or point.certificate.certified or not is_below(lowest, point.less(PROGRESS)):
            return False
        self.run.point = lowest
        return True

    def _descend_at_last(self):
        """Descend from a point that was not worth it on the way, as the homotopy promised better ones that it did not find."""
        point = self.run.point
        if point is not None and point.certificate.grade is Stationarity.DESCENT:
            self._branches.attempts.forget()
            self._branches.improve_from(point, True)

    def _settle(self):
        """Go to more even solutions and try all orders of changes, until neither leads on."""
        if self._completions is not None:
            # an order may lead on from their end, and what is more even than that would not matter
            self._coincidences.settle()
        for _ in range(ROUNDS):
            self._evenness.improve()
            before = self.run.point
            self._coincidences.settle()
            if self.run.point is before:
                return

    def _complete(self):
        """Rounds of relaxation, completion and branch, where points can be completed and something is to be minimised.

        Returns whether there were any, and there is a feasible point.
        """
        if self._completions is None:
            return False
        self._completions.follow(self._c.x0)
        return self.run.point is not None

    def _follow_path(self):
        """The homotopy from the start; where it finds no feasible point, from a further start."""
        path = self._path(self._c.x0, self._branches)
        further = self._setup.further_start
        path.follow(None if further is None else self._setup.deadline.part(PATIENCE))
        if self._start_is_better():
            self._branches.explore_from(self._c.x0, False)
        if self.run.point is None and further is not None:
            self._start_further(*further())
        if self.run.point is None:
            path.follow()

    def _start_further(self, w, note):
        """The branch of another start, or a path from there."""
        if note:
            self._subsolves.note(note, self._c.x0 if w is None else w)
        if w is None:
            return
        self._branches.attempts.forget()
        self._gap.restart()
        self._subsolves.keep_least_infeasible(w)
        self._branches.explore_from(w, True)
        if self.run.point is None:
            self._path(w, self._branches).follow()

    def _feasible_without_branch(self):
        """A point, perhaps the start, where rows and pairs hold although no branch from there was solved."""
        w = self.run.w if self.run.complementary is None else self.run.complementary
        if w is None:
            return None
        certificate, f = self._subsolves.measure(w), self._c.evaluate(w).f
        if not certificate.feasible:
            return None
        given = NlpResult(w, f, 'given', 0, np.zeros(0), np.zeros(0))
        return Point(given, f, replace(certificate, grade=Stationarity.UNTRIED))

    def _starts_at_a_solution(self):
        """Whether there is no objective and the start is feasible already."""
        if self._c.has_objective:
            return False
        narrow = self._c.widen()
        self.run.point, self.run.refused = feasible_start(self._c, self._subsolves, self._c.x0)
        if self.run.refused and self._options.warm_start:
            self._subsolves.note(f"start not accepted, {self.run.refused}", self._c.x0)
        if narrow:
            self._c.narrow()
        return self.run.point is not None

    def _relaxation_only(self):
        """The homotopy alone, for comparison: its end is neither exactly complementary nor certified."""
        path = self._path(self._c.x0, None)
        try:
            path.follow()
        finally:
            # the last relaxation counts also if a limit stopped the path
            end = path.end
            if end is not None:
                self.run.point = Point(end, self._c.evaluate(end.w).f, self._subsolves.measure(end.w))
        if end is not None and (path.finished or self.run.point.certificate.feasible):
            return Outcome.RELAXED
        self.run.point = None
        return Outcome.INFEASIBLE

    def _path(self, start, branches):
        return Homotopy(self._setup, self._subsolves, self._gap, branches, start)

    def _from_values(self):
        """Whether the branch that the start values name leads to a certified point."""
        self._subsolves.keep_least_infeasible(self._c.x0)
        if not self._branches.explore_decided(self._c.x0):
            self._branches.explore_from(self._c.x0, False)
        # its values say where to look: nothing else may follow (``ONLY``), or the homotopy, which takes longer
        self._certify_at_last()
        return self._is_certified()

    def _start_is_better(self):
        """Whether the path led to no certified point, or to one above a start that is feasible."""
        point, start = self.run.point, self._c.x0
        if point is None or not point.certificate.certified:
            return True
        return point.f > self._c.evaluate(start).f and self._subsolves.measure(start).feasible

    def _search_everywhere(self):
        """Without a feasible point on the path: search the branches, for few pairs also from other starts.

        At the end the restoration shows the rows and pairs that contradict each other.
        """
        hopeless = self._branches.exhaust(self._c.x0) is Verdict.NONE
        if not hopeless:
            self._branches.search(self.run.w, self._c.x0)
        for number in range(1, 1 + RESTARTS * self._may_differ(hopeless)):
            if self.run.point is not None:
                return
            start = start_point(self._c, self._c.x0, self._options.seed, number)
            self._subsolves.note("start elsewhere", start)
            if hopeless and self._branches.exhaust(start) is not Verdict.FOUND:
                continue
            self._gap.restart()
            self._branches.attempts.forget()
            self._path(start, self._branches).follow()
            if self.run.point is None:
                self._branches.search(self.run.w, start)
        if self.run.point is None:
            self.run.w = self._subsolves.restore(self.run.w, self._options.eps_final).w
            self._branches.explore_from(self.run.w, True)

    def _may_differ(self, hopeless):
        """Whether another start may have another answer: one search of all branches is a proof where everything is linear."""
        return few_pairs(self._c) and not (hopeless and self._c.linear)


#: option ``mode`` -> the method that runs
MODES = {'hybrid': HybridSolver._hybrid, 'relaxation': HybridSolver._relaxation_only}
