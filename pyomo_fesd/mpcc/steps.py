"""Single steps of the hybrid algorithm: each is checked against the limits, timed, counted and shown."""

import time
from contextlib import contextmanager
from functools import partial

import numpy as np

from pyomo_fesd.mpcc.branch import Branch
from pyomo_fesd.mpcc.feasibility import Feasibility
from pyomo_fesd.mpcc.lpec import Lpec
from pyomo_fesd.mpcc.nlp import nlp_solver
from pyomo_fesd.mpcc.phase import phase
from pyomo_fesd.mpcc.relaxation import RELAXATIONS
from pyomo_fesd.mpcc.run import Outcome, Step, Stop
from pyomo_fesd.mpcc.stationarity import certify, measure

#: Both sides within this factor of the root of the largest product: which of them goes to zero is not decided yet.
BIACTIVE = 3.0

#: HiGHS for an LPEC that only suggests a branch: the first that it finds will do, in this share of the time that the NLPs took.
SUGGESTION = {'mip_max_nodes': 100, 'mip_max_improving_sols': 1, 'presolve': 'off'}
SHARE, LEAST_TIME = 0.2, 0.2

#: What NLP solvers say of a problem that they found infeasible: the model's own rows may hold there, the pairs do not.
INFEASIBLE = ('Infeasible_Problem_Detected', 'infeasible')


#: Iterations that an NLP may use; a relaxation without multipliers to start from may use more.
COLD = 4
ITERATIONS = {
    'relaxation': lambda options: COLD * options.relaxation_iterations,
    'branch': lambda options: options.branch_iterations,
}


class Steps:
    """The NLPs and LPECs of one compiled MPCC, built when they are first needed.

    Parameters
    ----------
    compiled : Compiled
    options : ConfigDict
        of ``mpec_hybrid``
    tolerances : Tolerances
    run : Run
        what the steps are recorded in
    timer : HierarchicalTimer
    show : callable Step -> None
        called after each NLP and LPEC
    deadline : Deadline
    built : Built
        prepared for these options
    """

    def __init__(self, compiled, options, tolerances, run, timer, show, deadline, built):
        self._c, self._options, self._tolerances, self.run = compiled, options, tolerances, run
        self._timer, self._show, self._deadline = timer, show, deadline
        self._sides, self._built, self._solver = built.sides, built.nlps, nlp_solver(options.nlp_solver)
        self._lpec = Lpec(compiled, self._sides, options.lpec_options.value(), deadline)

    # what the algorithm calls

    def relax(self, form, w, eps, duals, max_iter=None):
        """Reg(eps) in a form of ``RELAXATIONS``, from ``w`` and perhaps a result of the same form."""
        kind, terms = RELAXATIONS[form]
        nlp = self._build(form, lambda make: kind(self._c, self._sides, terms, make), 'relaxation')
        return self._nlp('relaxation', eps, lambda: nlp.solve(w, eps, duals, max_iter))

    def restore(self, w, eps):
        """The feasibility phase."""
        nlp = self._build('feasibility', lambda make: Feasibility(self._c, self._sides, make), 'relaxation')
        return self._nlp('restoration', eps, lambda: nlp.solve(w, eps))

    def branch(self, w, zero, equal, weight, **more):
        """A branch NLP; None if it contradicts the bounds or ends nowhere."""
        nlp = self._build('branch', lambda make: Branch(self._c, self._sides, make), 'branch')
        result = self._nlp('branch', 0.0, lambda: nlp.solve(w, zero, equal, weight, **more))
        return result if result is not None and self.usable(result) else None

    def lpec(self, w, sets, Delta, equal=None, **more):
        """An LPEC that only has to point to a good branch."""
        with self._timed('lpec') as started:
            result = self._lpec.solve(w, sets, Delta, equal, **more)
        self._count(result)
        self._log('lpec', 0.0, w, 0, f'{result.value:.1e}' if result.solved else 'unsolved', started)
        return result

    def suggestion(self, w, sets, Delta):
        """An LPEC that may give up early."""
        spent = sum(step.seconds for step in self.run.steps if step.kind in ('relaxation', 'branch'))
        return self.lpec(w, sets, Delta, limits=SUGGESTION | {'time_limit': max(LEAST_TIME, SHARE * spent)})

    def certify(self, nlp, equal):
        """The certificate for the solution of a branch NLP.  No limit keeps it from being judged; HiGHS stops at the deadline."""
        started = time.perf_counter()
        with phase(self._timer, 'lpec'):
            certificate = certify(self._c, self._lpec, nlp.w, self._tolerances, equal, -nlp.lam_g)
        if certificate.lpec is not None:
            self._count(certificate.lpec)
        self._log('certificate', 0.0, nlp.w, 0, certificate.grade.name, started)
        return certificate

    def measure(self, w):
        """The residuals of a relaxation's solution, or of the start."""
        return measure(self._c, w, self._tolerances)

    def keep_least_infeasible(self, w):
        """Remember the point to report if nothing feasible is found."""
        if self.run.w is None or self.violation(w) < self.violation(self.run.w):
            self.run.w = w

    def note(self, what, w):
        """A line in the log that costs nothing."""
        self._log('recovery', 0.0, w, 0, what, time.perf_counter())

    def usable(self, result):
        """Whether an NLP's point can lead on: solved, or stopped where the model's constraints hold, but not as infeasible."""
        return result.solved or (result.status not in INFEASIBLE and self.violation(result.w) <= self._tolerances.feasibility)

    def violation(self, w):
        """The largest violation of rows and bounds."""
        rows, bounds = self._c.violations(w)
        return float(max(rows.max(initial=0.0), bounds.max(initial=0.0)))

    def biactive(self, at):
        """Below this both sides of a pair may be zero at the solution: O(sqrt) of the largest product left (eq. 16)."""
        return max(BIACTIVE * np.sqrt(np.max(at.G * at.H, initial=0.0)), self._tolerances.biactive)

    # how they run

    def _build(self, name, construct, kind):
        if name not in self._built:
            with self._timed('build'):
                self._built[name] = construct(partial(self._make, kind))
        return self._built[name]

    def _make(self, kind, name, x, p, f, g, budget=None, derivatives=None):
        """An NLP solver of the user's choice, with the limits that its kind has."""
        options = self._options
        ours = {'max_iter': ITERATIONS[kind](options), 'tol': getattr(options, f'{kind}_tol')} | (budget or {})
        return self._solver(name, x, p, f, g, ours, self._deadline, derivatives, options.nlp_options.value())

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
        """Check the limits, then time what follows; gives the time at which it began."""
        self._check_limits()
        with phase(self._timer, kind):
            yield time.perf_counter()

    def _check_limits(self):
        if self._deadline.expired():
            raise Stop(Outcome.TIME_LIMIT)
        if self.run.counts.iterations >= self._options.max_iterations:
            raise Stop(Outcome.ITERATION_LIMIT)

    def _count(self, result):
        self.run.counts.lpecs += 1
        self.run.counts.binaries = max(self.run.counts.binaries, result.binaries)

    def _log(self, kind, eps, w, iterations, status, started):
        c = self._c
        at = c.evaluate(w)
        low = np.minimum(at.G, at.H)
        violation = max(self.violation(w), -low.min(initial=0.0))
        biactive = int(np.count_nonzero(np.maximum(at.G, at.H) <= self.biactive(at)))
        gap = float(np.abs(low).max(initial=0.0))
        seconds = time.perf_counter() - started
        step = Step(kind, eps, c.objective(at.f), float(violation), gap, biactive, iterations, status, seconds, w)
        self.run.steps.append(step)
        self._show(step)
