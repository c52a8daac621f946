"""The hybrid active-set algorithm (theory, section 4): Reg(eps) -> active sets -> branch NLP -> certificate.

Reg(eps) leads; as soon as its active sets look settled, the branch NLP that they name is solved: an exactly complementary point,
which the LPEC certifies or from which it descends into a better branch.  The homotopy goes on while its objective promises less
than the incumbent's (gap test), and eps may rise again when a relaxation fails.
"""

from collections import Counter

import numpy as np

from pyomo_fesd.mpcc.active_set import active_sets
from pyomo_fesd.mpcc.gap import GapTest
from pyomo_fesd.mpcc.recovery import LADDER
from pyomo_fesd.mpcc.run import Outcome, Point, Run, Stop, Tolerances
from pyomo_fesd.mpcc.stationarity import Stationarity
from pyomo_fesd.mpcc.steps import Steps

#: A branch NLP's objective must fall by this, relative, to count as descent.
PROGRESS = 1e-8
#: Attempts at a branch NLP before it counts as infeasible, and the iterations that the early ones may use.
TRIES, EARLY = 3, 60
#: With products below this and the same sides as before, a smaller eps shows nothing new.
EXHAUSTED = 1e-8
#: The trust region of a descent step shrinks by this, so often.
SHRINK, SHRINKS = 0.1, 3
#: A feasible point with variables beyond this has run away along an unbounded objective.
UNBOUNDED = 1e15
#: Trust region of the LPEC that looks for any feasible branch.
FAR = 1e3
#: Branch-and-bound nodes for an LPEC that only suggests a branch.
SUGGESTION = {'mip_max_nodes': 100}
#: Without an objective any solution will do, and the elastic form is by far the quickest to one; with an objective it settles
#: early in worse minima than Scholtes' (gas-liquid optimal control: 250.005 instead of 250).  A failure changes the form.
AUTO = {False: ('elastic', 'scholtes'), True: ('scholtes', 'elastic')}


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
        self._tolerances = Tolerances(
            options.feasibility_tol, options.biactive_tol, options.descent_tol, options.eta_tol, options.trust_radius
        )
        self.run = Run()
        self._after = after
        self._steps = Steps(compiled, options, self._tolerances, self.run, timer, show, deadline, built)
        self._forms = (options.relaxation,) if options.relaxation != 'auto' else AUTO[compiled.has_objective]
        self._gap = GapTest(options.gap_tol * 1e-2, options.gap_tol)
        self._tried = Counter()

    def solve(self):
        """Run to a certified point or an honest end; returns the ``Run``."""
        run = self.run
        try:
            self._homotopy()
            if run.point is None:
                self._last_resort()
            run.outcome = self._verdict()
        except Stop as stop:
            run.outcome = stop.outcome
        except KeyboardInterrupt:
            run.outcome = Outcome.INTERRUPTED
        if run.point is not None:
            run.w = run.point.w
        return run

    def _verdict(self):
        point = self.run.point
        if point is None:
            return Outcome.INFEASIBLE
        if not point.certificate.certified:
            return Outcome.FEASIBLE
        return Outcome.CERTIFIED if self._c.has_objective else Outcome.SOLVED

    # the homotopy

    def _homotopy(self):
        options = self._options
        if options.warm_start and self._from_values():
            return
        form, ladder = 0, list(LADDER)
        w, eps, duals, previous = self._c.x0, options.eps_init, None, None
        while True:
            self.run.eps = eps
            relaxed = self._steps.relax(self._forms[form], w, eps, duals)
            self._keep_least_infeasible(relaxed.w)
            if not self._steps.usable(relaxed):
                self._after(self.run)
                if not ladder:
                    return
                step = ladder.pop(0)
                self._steps.note(step.what, relaxed.w)
                w = step.start(self._c.x0, relaxed.w, self)
                eps = max(step.eps(options.eps_init, eps, options.eps_factor), options.eps_final)
                form, duals, previous = (form + step.other_form) % len(self._forms), None, None
                self._gap.restart()
                continue
            w, duals = relaxed.w, relaxed
            at = self._c.evaluate(w)
            self._gap.add(eps, at.f)
            sets = active_sets(at.G, at.H, self._steps.biactive(at))
            last = eps <= 1.001 * options.eps_final  # products of eps_factor carry round-off
            exhausted = np.max(at.G * at.H, initial=0.0) <= EXHAUSTED and sets.same_sides(previous)
            ripe = sets.same_sides(previous) or last or not sets.gamma.any()
            if ripe:
                self._explore(relaxed, sets, last or exhausted)
            self._after(self.run)
            if ripe and self._settled():
                return
            if last or (exhausted and self._tried[sets.zero.tobytes()] >= TRIES):
                if self.run.point is not None or form + 1 == len(self._forms):
                    return
                # nothing feasible at the end of this form's path: the other form takes another one
                self._steps.note("nothing feasible on this path, other form", w)
                w, eps, duals, form, previous = self._c.x0, options.eps_init, None, form + 1, None
                self._gap.restart()
                self._tried.clear()
                continue
            previous, eps = sets, max(eps * options.eps_factor, options.eps_final)

    def _from_values(self):
        """Whether the branch that the start values name leads to a certified point."""
        self._keep_least_infeasible(self._c.x0)
        self._explore(None, active_sets(*self._sides(self._c.x0), self._tolerances.biactive), False)
        return self.run.point is not None and self.run.point.certificate.certified

    def restore(self, w):
        """The nearest point that the feasibility phase finds, with pairs as loose as at the start."""
        return self._steps.restore(w, self._options.eps_init).w

    def _keep_least_infeasible(self, w):
        """Remember the point to report if nothing feasible is found."""
        if self.run.w is None or self._steps.violation(w) < self._steps.violation(self.run.w):
            self.run.w = w

    def _settled(self):
        point = self.run.point
        return point is not None and point.certificate.certified and self._gap.closed(point.f)

    def _last_resort(self):
        """Nothing feasible: the LPEC with every pair as a binary names the branch whose linearisation is feasible, if there is one.

        Otherwise the feasibility phase shows what contradicts.
        """
        self._tried.clear()
        for w in (self.run.w, self._c.x0):
            sets = active_sets(*self._sides(w), np.inf)
            step = self._steps.lpec(w, sets, FAR, limits=SUGGESTION)
            if step.solved:
                self._improve_from(self._point(w + step.d, step.zero, None, True))
            if self.run.point is not None:
                return
        self.run.w = self._steps.restore(self.run.w, self._options.eps_final).w
        self._explore(None, active_sets(*self._sides(self.run.w), self._tolerances.biactive), True)

    # branches

    def _explore(self, relaxed, sets, final):
        """Solve the branch that the active sets name; descend from it as long as the LPEC shows a way."""
        zero, w = sets.zero, self.run.w if relaxed is None else relaxed.w
        if sets.gamma.any() and self._c.has_objective and self._tried[zero.tobytes()] < TRIES:
            zero = self._steps.lpec(w, sets, self._tolerances.radius, limits=SUGGESTION).zero
        self._improve_from(self._point(w, zero, relaxed, final))

    def _improve_from(self, point):
        """Keep ``point`` and what descends from it."""
        while point is not None:
            self._keep(point)
            point = self._descend(point) if point.certificate.grade is Stationarity.DESCENT else None

    def _descend(self, point):
        """A better point in the branch of the LPEC's direction: from its end, or within ever smaller trust regions."""
        enough = point.f - PROGRESS * max(1.0, abs(point.f))
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

    def _sides(self, w):
        at = self._c.evaluate(w)
        return at.G, at.H

    def _keep(self, point):
        """Keep the better of the incumbent and ``point``: certified before uncertified, then the lower objective."""
        best = self.run.point
        if best is None or (not point.certificate.certified, point.f) < (not best.certificate.certified, best.f):
            self.run.point = point

    def _point(self, w, zero, duals, final):
        """The solution of branch ``zero``, certified; None if it has none.

        A branch that was solved is not solved again; one that failed gets more tries, from better points, with and without
        multipliers in turn.
        """
        key = zero.tobytes()
        if self._tried[key] >= TRIES:
            return None
        self._tried[key] += 1
        patient = final or self._tried[key] == TRIES
        point = self._certified(w, zero, duals=duals if self._tried[key] != 2 else None, max_iter=None if patient else EARLY)
        if point is None and final and duals is not None:
            point = self._certified(w, zero, duals=None)
        if point is not None and point.certificate.grade is not Stationarity.DESCENT:
            self._tried[key] = TRIES
        return point

    def _certified(self, w, zero, duals=None, **more):
        solved, equal = self._solve_branch(w, zero, duals, **more)
        if solved is None:
            return None
        if np.abs(solved.w).max(initial=0.0) > UNBOUNDED:
            raise Stop(Outcome.UNBOUNDED)
        certificate = self._steps.certify(solved, equal)
        if not certificate.feasible:
            return None
        return Point(solved, self._c.evaluate(solved.w).f, certificate, equal)

    def _solve_branch(self, w, zero, duals, **more):
        """Two stages where pairs are to be decided (eq. 13): with the penalty to read eta, then with what eta decides."""
        c = self._c
        first = self._steps.branch(w, zero, None, 1.0, duals=duals, **more)
        if first is None or not c.eta.numel():
            return first, None
        equal = c.evaluate(first.w).eta > self._tolerances.eta
        return self._steps.branch(first.w, zero, equal, 0.0, duals=first, **more), equal
