"""Single NLPs and LPECs of the hybrid algorithm: each is checked against the limits, timed, counted and logged."""

import time
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from pyomo_fesd.core import DeferredInterrupt, phase
from pyomo_fesd.mpcc.algorithm.state import LogEntry, Outcome, Run, Setup, Stop, Tolerances
from pyomo_fesd.mpcc.nlp import DIVERGING, STALLED, nlp_solver
from pyomo_fesd.mpcc.subproblems import (
    RELAXATIONS,
    Branch,
    EndInsertions,
    Insertions,
    Lpec,
    Parts,
    Restoration,
    active_sets,
    certify_point,
    measure,
    settle,
)

#: With both sides within this factor of the root of the largest product, a pair is undecided.
BIACTIVE = 3.0
#: HiGHS for an LPEC that only suggests a branch: the first solution is enough, in this share of the time that the NLPs took.  The
#: least time is four times what a tank's with a binary for every pair takes (with 0.5 s its plan depended on other work of the
#: machine; MacMPEC and NOSBENCH take the same time with both).
SUGGESTION = {'mip_max_nodes': 100, 'mip_max_improving_sols': 1, 'presolve': 'off'}
SHARE, LEAST_TIME = 0.2, 2.0
#: Least seconds for the LPECs of an order: without their answer no point is certified, and a loaded machine should not decide that.
ORDER_TIME = 5.0
#: Statuses of a problem that an NLP solver found infeasible: the model's own rows may hold there, the pairs do not.
INFEASIBLE = ('Infeasible_Problem_Detected', 'infeasible')
#: Statuses where Ipopt cannot make the violation smaller, and the violation from which on such a point is none: a multiplier may be
#: so large that the objective owes all to what is left, as with a force of 1e7 at a gap of 1e-8.
STUCK, LEFT = ('Restoration_Failed', STALLED), 1e-8
#: Ipopt scales rows and an objective down whose gradients at the start of an NLP have larger entries than this; and rows where
#: parts have extents, without impacts.
STEEP, STEEPEST_ROW = 1e2, 1e4
#: How the names of Ipopt's options of this scaling begin.
OF_SCALING = 'nlp_scaling', 'obj_scaling'
#: Ipopt's barrier parameter where a relaxation beside impacts starts with multipliers: its adaptive one follows them to worse
#: points (a hopper at eps 6e-6: to 15.1, and this one was at 7.6).
CENTRED = {'mu_strategy': 'monotone', 'mu_init': 1e-3}
#: Statuses with which a point is of no use, whatever its violation.
USELESS = (*INFEASIBLE, DIVERGING)
#: Iterations that an NLP may use; a relaxation without multipliers to start from may use more.
COLD = 4
ITERATIONS = {
    'relaxation': lambda options: COLD * options.relaxation_iterations,
    'branch': lambda options: options.branch_iterations,
}


class Subsolves:
    """The NLPs and LPECs of one run on a compiled MPCC, built when they are first needed."""

    def __init__(self, setup: Setup, tolerances: Tolerances, run: Run):
        self.compiled, self.tolerances, self.run = setup.compiled, tolerances, run
        self._c, self._setup, self._options = setup.compiled, setup, setup.options
        self._sides, self._nlps, self._solver = setup.cache.sides, setup.cache.nlps, nlp_solver(setup.options.nlp_solver)
        self._lpec = Lpec(self._c, self._sides, self._options.lpec_options.value(), setup.deadline)
        self.parts = Parts(self._c)

    # called by the algorithm

    def relax(self, form, w, eps, duals, max_iter=None, fall=None):
        """Solve Reg(eps) in a form of ``RELAXATIONS``, from ``w`` and perhaps a result of the same form."""
        kind, terms = RELAXATIONS[form]
        nlp = self._build(form, lambda make: kind(self._c, self._sides, terms, make), 'relaxation')
        return self._nlp('relaxation', eps, lambda: nlp.solve(w, eps, duals, max_iter, fall))

    def restore(self, w, eps):
        """Solve the restoration NLP."""
        nlp = self._build('restoration', lambda make: Restoration(self._c, self._sides, make), 'relaxation')
        return self._nlp('restoration', eps, lambda: nlp.solve(w, eps))

    def branch(self, w, zero, equal, weight, **more):
        """Solve a branch NLP; None if it contradicts the bounds or ends without a usable point."""
        result = self.attempt(w, zero, equal, weight, **more)
        return result if result is not None and self.usable(result) else None

    def node(self, w, zero, max_iter):
        """Solve a branch NLP in which pairs may be open; its usable result or None, and whether it was found infeasible."""
        result = self.attempt(w, zero, None, 1.0, max_iter=max_iter)
        if result is None:
            return None, True
        if self.usable(result):
            return result, False
        return None, result.status in INFEASIBLE or self._branches().infeasible(zero)

    def attempt(self, w, zero, equal, weight, **more):
        """The result of a branch NLP, usable or not; None if the branch contradicts the bounds."""
        return self._nlp('branch', 0.0, lambda: self._branches().solve(w, zero, equal, weight, **more))

    def on_sides(self, w, zero):
        """``w`` within the bounds of a branch; None if these contradict each other."""
        return self._branches().on_sides(w, zero)

    def asked(self, w, zero):
        """The decisions that the sides of a branch ask for: their eta is positive inside it; None if its bounds contradict.

        At its ends, where a free side is 0 as well, eta is that of other branches: an impact without an impulse is no change.
        """
        inside = self._branches().inside(w, zero)
        return None if inside is None else self._c.evaluate(inside).eta > self.tolerances.eta

    def _branches(self):
        return self._build('branch', lambda make: Branch(self._c, self._sides, make), 'branch')

    def lpec(self, w, sets, Delta, equal=None, **more):
        """Solve an LPEC for a direction to a better branch."""
        with self._timed('lpec') as started:
            result = self._lpec.solve(w, sets, Delta, self.in_force(w, equal), **more)
        self._count(result)
        self._log('lpec', 0.0, w, 0, f'{result.value:.1e}' if result.solved else 'unsolved', started)
        return result

    def in_force(self, w, equal):
        """The decisions ``equal`` of a branch NLP that eta still asks for at ``w``; None stays None.

        Where eta has become 0, both sides of the pair (13) are zero there: what is shown with the decision says nothing of the
        points without it.
        """
        return None if equal is None else equal & (self._c.evaluate(w).eta > self.tolerances.eta)

    def insertion(self, point, sets, order, unchanged):
        """The ``Verdict`` of parts that are inserted into a point in a row; ``unchanged`` are such that change nothing there."""
        return self._verdict(Insertions, point, sets, order, unchanged)

    def insertion_at_end(self, point, sets, order):
        """The ``Verdict`` of a part of no extent at an end of a point."""
        return self._verdict(EndInsertions, point, sets, order)

    def _verdict(self, kind, point, sets, *order):
        """The ``Verdict`` of a kind of insertion; not decided where its LPECs would take long: there may be many orders."""
        equal = self._c.evaluate(point.w).eta > self.tolerances.eta if point.equal is None else self.in_force(point.w, point.equal)
        with self._timed('lpec') as started:
            verdict = self._insertions(kind, self._seconds(ORDER_TIME)).verdict(point.w, sets, equal, *order)
        self._log('order', 0.0, point.w, 0, verdict.value, started)
        return verdict

    def at_limit(self, w, zero, extents, size):
        """``w`` with the values that parts of extent 0 have as they grow; None without any."""
        return self._insertions(Insertions).at_limit(w, zero, extents, size)

    def _insertions(self, kind, seconds=None):
        """A kind of insertion, whose LPECs have so many seconds from now on; None: as they are."""
        return kind(self._c, self._sides, self.parts, self._lpec.at_most(seconds), self.tolerances)

    def suggestion(self, w, sets, Delta):
        """Solve an LPEC that may stop early."""
        return self.lpec(w, sets, Delta, limits=SUGGESTION | self.patience())

    def patience(self) -> dict:
        """HiGHS' limit of time for an LPEC that proves nothing."""
        return {'time_limit': self._seconds(LEAST_TIME)}

    def _seconds(self, least):
        """A share of the time that the NLPs took, and at least so many seconds."""
        return max(least, SHARE * sum(step.seconds for step in self.run.steps if step.kind in ('relaxation', 'branch')))

    def certify(self, nlp, equal, at_last=False):
        """Certify the end of a branch NLP, whatever the limits; HiGHS stops at the deadline.

        Where the NLP did not reach its solution exactly a certificate is unlikely, and its LPEC may take longer than all NLPs: it
        stops early, unless the run ends with this point.
        """
        started, seconds = time.perf_counter(), self._seconds(LEAST_TIME)
        lpec = self._lpec.at_most(None if nlp.is_exact or at_last else seconds)
        with phase(self._setup.timer, 'lpec'):
            certificate = certify_point(self._c, lpec, nlp.w, self.tolerances, self.in_force(nlp.w, equal), -nlp.lam_g, seconds)
        if certificate.lpec is not None:
            self._count(certificate.lpec)
        self._log('certificate', 0.0, nlp.w, 0, certificate.grade.name, started)
        return certificate

    def judge(self, w):
        """Certify any point."""
        return certify_point(self._c, self._lpec, w, self.tolerances)

    def measure(self, w):
        """The residuals of a relaxation's solution, or of the start."""
        return measure(self._c, w, self.tolerances)

    def keep_least_infeasible(self, w):
        """Keep the point to report if no branch is solved: that of the least violation, and the best complementary one."""
        if self.run.w is None or self.violation(w) < self.violation(self.run.w):
            self.run.w = w
        if self.run.point is None and self._c.has_objective and self.measure(w).feasible:
            best = self.run.complementary
            if best is None or self._c.evaluate(w).f < self._c.evaluate(best).f:
                self.run.complementary = w

    def completed(self, complete, w, seconds):
        """The completion of ``w`` by ``complete`` (that of ``Setup``), and whether it is complete."""
        with self._timed('recovery') as started:
            completed, is_complete, note = complete(w, seconds)
        self._log('recovery', 0.0, completed, 0, note, started)
        return completed, is_complete

    def note(self, message, w):
        """Log a message without running a solver."""
        self._log('recovery', 0.0, w, 0, message, time.perf_counter())

    def usable(self, result):
        """Whether an NLP's point can be used: solved, or stopped where the model's constraints hold, but not as infeasible."""
        most = min(LEFT, self.tolerances.feasibility) if result.status in STUCK else self.tolerances.feasibility
        return result.solved or (result.status not in USELESS and self.violation(result.w) <= most)

    def violation(self, w):
        """The largest violation of rows and bounds."""
        rows, bounds = self._c.violations(w)
        return float(max(rows.max(initial=0.0), bounds.max(initial=0.0)))

    def sets(self, w, tolerance):
        """Active sets at ``w``, settled; with ``tolerance`` for bi-active pairs."""
        at = self._c.evaluate(w)
        sets = active_sets(at.G, at.H, tolerance)
        return replace(sets, zero=settle(self._c, self._sides, w, sets.zero))

    def settled(self, w, zero):
        """The assignment of the branch ``zero`` that starts at ``w``."""
        return settle(self._c, self._sides, w, zero)

    def held(self, w, zero):
        """For each variable the bound at which the branch ``zero`` keeps it at ``w``: 1 the lower one, -1 the upper one, 0 none."""
        low, high = self._sides.bounds(self.settled(w, zero), self._c.lbx, self._c.ubx)
        return np.where(low == high, (high < self._c.ubx).astype(int) - (low > self._c.lbx), 0)

    def biactive(self, at):
        """Below this both sides of a pair may be zero at the solution: O(sqrt) of the largest product left (eq. 16)."""
        return max(BIACTIVE * np.sqrt(np.max(at.G * at.H, initial=0.0)), self.tolerances.biactive)

    # how they run

    def _build(self, name, construct, kind):
        if name not in self._nlps:
            with self._timed('build'):
                self._nlps[name] = construct(partial(self._make, kind))
        return self._nlps[name]

    def _make(self, kind, name, x, p, f, g, budget=None, derivatives=None):
        """An NLP solver of the user's choice, with the limits of its kind."""
        options = self._options
        ours = {'max_iter': ITERATIONS[kind](options), 'tol': getattr(options, f'{kind}_tol')} | self._scaling | (budget or {})
        warm = CENTRED if kind == 'relaxation' and self._c.impacts else None
        given = options.nlp_options.value()
        return self._solver(name, x, p, f, g, ours, self._setup.deadline, derivatives, given, warm, self._shifts)

    @property
    def _shifts(self):
        """Whether Ipopt gets a shifted Hessian: beside impacts, without completions.

        With these, budgets end most relaxations, and one with a shifted Hessian has not come as far by then: discs from four starts
        took 1,751 to 7,601 iterations with the shift, and 1,737 to 3,145 without it.  Without impacts a tank took twice as long.
        """
        return bool(self._c.impacts) and self._setup.complete is None

    @cached_property
    def _scaling(self):
        """Options with which Ipopt leaves steeper rows as they are where parts have extents, and the objective has its own factor.

        The slope of a row by an extent is a rate.  Rates at the start, by which Ipopt would scale rows down, say little of those
        elsewhere, and rows that are scaled down count less.  None beside impacts, whose impulses may have any size: no gain was
        seen there.  None if the user says how Ipopt scales.
        """
        given = any(name.startswith(OF_SCALING) for name in self._options.nlp_options.value())
        if not self.parts.all or self._c.impacts or given:
            return {}
        slopes = np.abs(self._c.gradients(self._c.x0)[0])
        steepest = slopes[np.isfinite(slopes)].max(initial=STEEP)
        return {'nlp_scaling_max_gradient': STEEPEST_ROW, 'obj_scaling_factor': float(STEEP / min(steepest, STEEPEST_ROW))}

    def _nlp(self, kind, eps, solve):
        with self._timed(kind) as started:
            result = solve()
        if result is not None:
            self.run.counts.nlps += 1
            self.run.counts.iterations += result.iterations
            self._log(kind, eps, result.w, result.iterations, result.status, started)
        return result

    @contextmanager
    def _timed(self, kind):
        """Check the limits, then time the body; yields the time at which it begins."""
        if self._setup.deadline.expired():
            raise Stop(Outcome.TIME_LIMIT)
        if self.run.counts.iterations >= self._options.max_iterations:
            raise Stop(Outcome.ITERATION_LIMIT)
        with DeferredInterrupt() as interrupt, phase(self._setup.timer, kind), interrupt.raising():
            yield time.perf_counter()

    def _count(self, result):
        self.run.counts.lpecs += 1
        self.run.counts.binaries = max(self.run.counts.binaries, result.binaries)

    def _log(self, kind, eps, w, iterations, status, started):
        at = self._c.evaluate(w)
        low = np.minimum(at.G, at.H)
        entry = LogEntry(
            kind,
            eps,
            self._c.objective(at.f),
            violation=float(max(self.violation(w), -low.min(initial=0.0))),
            complementarity=float(np.abs(low).max(initial=0.0)),
            biactive=int(np.count_nonzero(np.maximum(at.G, at.H) <= self.biactive(at))),
            iterations=iterations,
            status=status,
            seconds=time.perf_counter() - started,
            w=w,
        )
        self.run.steps.append(entry)
        self._setup.show(entry)
