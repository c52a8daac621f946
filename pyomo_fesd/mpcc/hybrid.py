"""The hybrid active-set algorithm (theory, section 4): Reg(eps) -> active sets -> branch NLP -> certificate.

Reg(eps) leads; as soon as its active sets look settled, the branch NLP that they name is solved: an exactly complementary point,
which the LPEC certifies or from which it descends into a better branch.  The homotopy goes on while its objective lies clearly
below the incumbent's (gap test), and eps may rise again when a relaxation fails.
"""

import time
from collections import Counter
from contextlib import contextmanager

import numpy as np

from pyomo_fesd.mpcc.active_set import active_sets
from pyomo_fesd.mpcc.branch import Branch
from pyomo_fesd.mpcc.lpec import Lpec
from pyomo_fesd.mpcc.relaxation import RELAXATIONS
from pyomo_fesd.mpcc.run import Outcome, Point, Run, Step, Tolerances
from pyomo_fesd.mpcc.sides import sort_sides
from pyomo_fesd.mpcc.stationarity import Stationarity, certify

#: A branch NLP's objective must fall by this, relative, to count as descent.
PROGRESS = 1e-8
#: Both sides within this factor of the root of the largest product: which of them goes to zero is not decided yet.
BIACTIVE = 3.0
#: Starts from which a branch NLP is tried before it counts as infeasible.
TRIES = 3
#: With products below this and the same sides as before, a smaller eps shows nothing new.
EXHAUSTED = 1e-8
#: A feasible point with variables beyond this has run away along an unbounded objective.
UNBOUNDED = 1e15
#: Without an objective any solution will do, and the elastic form is by far the quickest to one; with an objective it settles
#: early in worse minima than Scholtes' (gas-liquid optimal control: 250.005 instead of 250).  A failure changes the form.
AUTO = {False: ('elastic', 'scholtes'), True: ('scholtes', 'elastic')}
#: After a failed relaxation: eps relative to its first value, and whether to start again from the model's values.
RECOVERY = ((1e-2, True), (10.0, False), (1e-4, True), (100.0, True))


class _Stop(Exception):
    """A limit was reached; carries the outcome."""

    def __init__(self, outcome):
        self.outcome = outcome


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
    deadline : float or None
        value of ``time.perf_counter()`` at which to stop
    """

    def __init__(self, compiled, options, timer, show, deadline=None):
        self._c, self._options, self._timer, self._show, self._deadline = compiled, options, timer, show, deadline
        self._tolerances = Tolerances(
            options.feasibility_tol, options.biactive_tol, options.descent_tol, options.eta_tol, options.trust_radius
        )
        ipopt = options.nlp_options.value()
        timer.start('build')
        self._sides = sort_sides(compiled)
        budget = {'max_iter': options.branch_iterations, 'tol': options.branch_tol}
        self._branch = Branch(compiled, self._sides, budget | ipopt, deadline)
        timer.stop('build')
        self._forms = [options.relaxation] if options.relaxation != 'auto' else AUTO[compiled.has_objective]
        self._relaxations = {}
        self._lpec = Lpec(compiled, options.lpec_options.value(), deadline)
        self._tried = Counter()
        self.run = Run()

    def solve(self):
        """Run to a certified point or an honest end; returns the ``Run``."""
        run = self.run
        try:
            self._homotopy()
            run.outcome = self._verdict()
        except _Stop as stop:
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
        form, *others = self._forms
        w, eps, previous, failures = self._c.x0, options.eps_init, None, 0
        while True:
            self.run.eps = eps
            relaxed = self._relax(form, w, eps)
            self._keep_least_infeasible(relaxed.w)
            if not self._usable(relaxed):
                if failures == len(RECOVERY):
                    return
                factor, restart = RECOVERY[failures]
                w = self._c.x0 if restart else relaxed.w
                eps, failures, previous = options.eps_init * factor, failures + 1, None
                form = self._forms[failures % len(self._forms)]
                continue
            w = relaxed.w
            at = self._c.evaluate(w)
            sets = active_sets(at.G, at.H, self._biactive(at))
            last = eps <= 1.001 * options.eps_final  # products of eps_factor carry round-off
            if sets.same_sides(previous) or last or not sets.gamma.any():
                self._explore(w, sets)
                if self._settled(at.f):
                    return
            exhausted = self._tried[sets.zero.tobytes()] >= TRIES and np.max(at.G * at.H, initial=0.0) <= EXHAUSTED
            if last or (exhausted and sets.same_sides(previous)):
                if self.run.point is not None or not others:
                    return
                # nothing feasible at the end of this form's path: the other form takes another one
                w, eps, form, previous = self._c.x0, options.eps_init, others.pop(0), None
                self._tried.clear()
                continue
            previous, eps = sets, max(eps * options.eps_factor, options.eps_final)

    def _usable(self, result):
        """Whether an NLP's point can lead on: solved, or stopped where its constraints hold."""
        return result.solved or self._violation(result.w) <= self._tolerances.feasibility

    def _violation(self, w):
        rows, bounds = self._c.violations(w)
        return float(max(rows.max(initial=0.0), bounds.max(initial=0.0)))

    def _keep_least_infeasible(self, w):
        """Remember the point to report if nothing feasible is found."""
        if self.run.w is None or self._violation(w) < self._violation(self.run.w):
            self.run.w = w

    def _biactive(self, at):
        """Below this both sides of a pair may be zero at the solution: O(sqrt) of the largest product left (eq. 16)."""
        return max(BIACTIVE * np.sqrt(np.max(at.G * at.H, initial=0.0)), self._tolerances.biactive)

    def _settled(self, f_relaxed):
        """Gap test: the incumbent is good enough if the relaxed objective no longer lies clearly below it."""
        point = self.run.point
        if point is None or not point.certificate.certified:
            return False
        return point.f - f_relaxed <= self._options.gap_tol * max(1.0, abs(point.f))

    # branches

    def _explore(self, w, sets):
        """Solve the branch that the active sets name; descend from it as long as the LPEC shows a way."""
        zero = sets.zero
        if sets.gamma.any() and self._c.has_objective:
            zero = self._lpec_step(w, sets).zero
        point = self._point(w, zero)
        while point is not None:
            self._keep(point)
            if point.certificate.grade is not Stationarity.DESCENT:
                return
            step = point.certificate.lpec
            better = self._point(point.w + step.d, step.zero)
            if better is None or better.f > point.f - PROGRESS * max(1.0, abs(point.f)):
                return
            point = better

    def _keep(self, point):
        """Keep the better of the incumbent and ``point``: certified before uncertified, then the lower objective."""
        best = self.run.point
        if best is None or (not point.certificate.certified, point.f) < (not best.certificate.certified, best.f):
            self.run.point = point

    def _point(self, w, zero):
        """The solution of branch ``zero``, certified; None if it has none.

        A branch that was solved is not solved again; one that failed gets more tries, from better points.
        """
        key = zero.tobytes()
        if self._tried[key] >= TRIES:
            return None
        self._tried[key] += 1
        solved, equal = self._solve_branch(w, zero)
        if solved is None:
            return None
        certificate = self._certify(solved.w, equal)
        if not certificate.feasible:
            return None
        self._tried[key] = TRIES
        if np.abs(solved.w).max(initial=0.0) > UNBOUNDED:
            raise _Stop(Outcome.UNBOUNDED)
        return Point(solved, self._c.evaluate(solved.w).f, certificate)

    def _solve_branch(self, w, zero):
        """Two stages where pairs are to be decided (eq. 13): with the penalty to read eta, then with what eta decides."""
        c = self._c
        decided = c.eta.numel()
        first = self._branch_nlp(w, zero, None, weight=1.0)
        if first is None or not decided:
            return first, None
        equal = c.evaluate(first.w).eta > self._tolerances.eta
        second = self._branch_nlp(first.w, zero, equal, weight=0.0)
        return second, equal

    # single steps, timed, counted and shown

    def _relax(self, form, w, eps):
        if form not in self._relaxations:
            options = self._options
            budget = {'max_iter': options.relaxation_iterations, 'tol': options.relaxation_tol}
            with self._timed('build'):
                self._relaxations[form] = RELAXATIONS[form](
                    self._c, self._sides, budget | options.nlp_options.value(), self._deadline
                )
        return self._nlp('relaxation', eps, lambda: self._relaxations[form].solve(w, eps))

    def _branch_nlp(self, w, zero, equal, weight):
        result = self._nlp('branch', 0.0, lambda: self._branch.solve(w, zero, equal, weight))
        return result if result is not None and self._usable(result) else None

    def _nlp(self, kind, eps, solve):
        with self._timed(kind) as started:
            result = solve()
        if result is not None:
            self.run.counts.nlps += 1
            self.run.counts.iterations += result.iterations
            self._log(kind, eps, result.w, result.iterations, result.status, started)
        return result

    def _lpec_step(self, w, sets):
        with self._timed('lpec') as started:
            result = self._lpec.solve(w, sets, self._tolerances.radius)
        self._count_lpec(result)
        self._log('lpec', 0.0, w, 0, f'{result.value:.1e}', started)
        return result

    def _certify(self, w, equal):
        with self._timed('lpec') as started:
            certificate = certify(self._c, self._lpec, w, self._tolerances, equal)
        if certificate.lpec is not None:
            self._count_lpec(certificate.lpec)
        self._log('certificate', 0.0, w, 0, certificate.grade.name, started)
        return certificate

    @contextmanager
    def _timed(self, kind):
        """Check the limits, then time what follows; gives the time at which it began."""
        self._check_limits()
        self._timer.start(kind)
        try:
            yield time.perf_counter()
        finally:
            self._timer.stop(kind)

    def _count_lpec(self, result):
        self.run.counts.lpecs += 1
        self.run.counts.binaries = max(self.run.counts.binaries, result.binaries)

    def _check_limits(self):
        if self._deadline is not None and time.perf_counter() > self._deadline:
            raise _Stop(Outcome.TIME_LIMIT)
        if self.run.counts.iterations >= self._options.max_iterations:
            raise _Stop(Outcome.ITERATION_LIMIT)

    def _log(self, kind, eps, w, iterations, status, started):
        c = self._c
        at = c.evaluate(w)
        low = np.minimum(at.G, at.H)
        violation = max(self._violation(w), -low.min(initial=0.0))
        biactive = int(np.count_nonzero(np.maximum(at.G, at.H) <= self._biactive(at)))
        step = Step(
            kind,
            eps,
            c.sign * at.f,
            float(violation),
            float(np.abs(low).max(initial=0.0)),
            biactive,
            iterations,
            status,
            time.perf_counter() - started,
            w,
        )
        self.run.steps.append(step)
        self._show(step)
