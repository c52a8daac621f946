"""The hybrid active-set algorithm (theory, section 4): Reg(eps) -> active sets -> branch NLP -> certificate.

Reg(eps) leads (``Homotopy``); the branches that it names give exactly complementary points, which the LPEC certifies or from which
it descends into better branches (``Branches``).
"""

from pyomo_fesd.mpcc.branches import Branches
from pyomo_fesd.mpcc.gap import GapTest
from pyomo_fesd.mpcc.homotopy import Homotopy
from pyomo_fesd.mpcc.run import Outcome, Point, Run, Stop, Tolerances
from pyomo_fesd.mpcc.start_points import start_point
from pyomo_fesd.mpcc.steps import Steps

#: Other starts of a problem with few pairs, before it is called infeasible.
RESTARTS = 3


def few_pairs(compiled):
    """Whether a problem is so small that a thorough look costs little."""
    return len(compiled.side_of) // 2 <= 50


#: option ``lpec`` -> whether a full LPEC, which few pairs make cheap, looks for better branches
FAR_SIGHTED = {
    'auto': few_pairs,
    'full': lambda compiled: True,
    'reduced': lambda compiled: False,
}


class HybridSolver:
    """Runs the algorithm on a compiled MPCC.

    Parameters
    ----------
    compiled : Compiled
    options : ConfigDict
        of ``mpec_hybrid``
    timer : HierarchicalTimer
    show : callable Step -> None
        called after each NLP and LPEC
    deadline : Deadline
    after : callable Run -> None
        called after every outer iteration; may raise Stop
    built : Built
        prepared for these options; shared with other runs on the same compiled MPCC and deadline
    """

    def __init__(self, compiled, options, timer, show, deadline, after, built):
        self._c, self._options = compiled, options
        tolerances = Tolerances.of(options)
        self.run = Run()
        self._steps = Steps(compiled, options, tolerances, self.run, timer, show, deadline, built)
        self._gap, self._after = GapTest(options.gap_tol * 1e-2, options.gap_tol), after
        self._branches = Branches(compiled, self._steps, tolerances, self._gap, FAR_SIGHTED[options.lpec](compiled))

    def solve(self):
        """Run to a certified point or an honest end; returns the ``Run``."""
        run = self.run
        if not self._options.warm_start:
            # short elements have more solutions than those that are meant; where these do not do, the path widens
            self._c.narrow()
        try:
            run.outcome = MODES[self._options.mode](self)
        except Stop as stop:
            run.outcome = stop.outcome
        except KeyboardInterrupt:
            run.outcome = Outcome.INTERRUPTED
        finally:
            self._c.widen()
        if run.point is not None:
            run.w = run.point.w
        return run

    def _hybrid(self):
        """The whole algorithm."""
        if not (self._options.warm_start and self._from_values()):
            self._path(self._c.x0, self._branches).follow()
            if self._start_is_better():
                self._branches.explore_from(self._c.x0, False)
            if self.run.point is not None and self._c.has_objective:
                self._branches.move()
        if self.run.point is None:
            self._last_resort()
        point = self.run.point
        if point is None:
            return Outcome.INFEASIBLE
        if not point.certificate.certified:
            return Outcome.FEASIBLE
        return Outcome.CERTIFIED if self._c.has_objective else Outcome.SOLVED

    def _relaxation_only(self):
        """The homotopy alone, for comparison: nothing is exactly complementary and nothing is certified."""
        path = self._path(self._c.x0, None)
        try:
            path.follow()
        finally:
            # a limit, too, leaves the last relaxation
            end = path.end
            if end is not None:
                self.run.point = Point(end, self._c.evaluate(end.w).f, self._steps.measure(end.w))
        if end is not None and (path.finished or self.run.point.certificate.feasible):
            return Outcome.RELAXED
        self.run.point = None
        return Outcome.INFEASIBLE

    def _path(self, start, branches):
        return Homotopy(self._c, self._options, self._steps, self._gap, branches, self._after, start)

    def _from_values(self):
        """Whether the branch that the start values name leads to a certified point."""
        self._steps.keep_least_infeasible(self._c.x0)
        self._branches.explore_from(self._c.x0, False)
        return self.run.point is not None and self.run.point.certificate.certified

    def _start_is_better(self):
        """Whether the path led to nothing certified, or to nothing as good as a start that is feasible, say from a simulation."""
        point, start = self.run.point, self._c.x0
        if point is None or not point.certificate.certified:
            return True
        return point.f > self._c.evaluate(start).f and self._steps.measure(start).feasible

    def _last_resort(self):
        """Nothing feasible on the path: the branches are searched, where they are few also from other starts.

        At the end the feasibility phase shows what contradicts.
        """
        self._branches.search(self.run.w, self._c.x0)
        for number in range(1, 1 + RESTARTS * few_pairs(self._c)):
            if self.run.point is not None:
                return
            start = start_point(self._c, self._c.x0, self._options.seed, number)
            self._steps.note("start elsewhere", start)
            self._gap.restart()
            self._branches.forget()
            self._path(start, self._branches).follow()
            if self.run.point is None:
                self._branches.search(self.run.w, start)
        if self.run.point is None:
            self.run.w = self._steps.restore(self.run.w, self._options.eps_final).w
            self._branches.explore_from(self.run.w, True)


#: option ``mode`` -> what it runs
MODES = {'hybrid': HybridSolver._hybrid, 'relaxation': HybridSolver._relaxation_only}
