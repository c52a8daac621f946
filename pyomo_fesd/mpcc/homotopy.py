"""The path of relaxations Reg(eps), from which branches are explored (theory, section 4).

As soon as the active sets of a relaxation look settled, the branch NLP that they name is solved.  The path goes on while its
objective promises less than the incumbent's (gap test), and eps may rise again when a relaxation fails.
"""

from dataclasses import dataclass

import numpy as np

from pyomo_fesd.mpcc.active_set import ActiveSets, active_sets
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.mpcc.recovery import LADDER

#: Without an objective any solution will do, and the elastic form is by far the quickest to one; with an objective it settles
#: early in worse minima than Scholtes' (gas-liquid optimal control: 250.005 instead of 250).  A failure changes the form.
AUTO = {False: ('elastic', 'scholtes'), True: ('scholtes', 'elastic')}
#: From this eps on multipliers are carried along; before, Ipopt's own centring finds better minima (a car: 13.3, not 16).
CARRIED = 1e-2
#: From this eps on a relaxation is worth a branch NLP, which is much cheaper than the next relaxation, unless more than this part
#: of the pairs could still go either way.
TELLING, UNDECIDED = 1e-3, 0.5
#: With products below this and the same sides as before, a smaller eps shows nothing new.
EXHAUSTED = 1e-8
#: Products of eps_factor carry round-off.
ROUND_OFF = 1.001


@dataclass(frozen=True)
class _Stage:
    """The next relaxation: its form, where it starts, and what the one before has shown."""

    form: int
    w: np.ndarray
    eps: float
    duals: NlpResult = None
    sets: ActiveSets = None
    named: float = None


class Homotopy:
    """One run along the path.

    Parameters
    ----------
    compiled : Compiled
    options : ConfigDict
    steps : Steps
    gap : GapTest
    branches : Branches or None
        what explores branches; None follows the path to its end
    after : callable Run -> None
        called after every relaxation and what it led to; may raise Stop
    start : array
        where the path begins
    """

    def __init__(self, compiled, options, steps, gap, branches, after, start):
        self._c, self._options, self._steps, self._gap, self._branches = compiled, options, steps, gap, branches
        self._after, self._start, self.run = after, start, steps.run
        self._forms = (options.relaxation,) if options.relaxation != 'auto' else AUTO[compiled.has_objective]
        self._ladder = list(LADDER)
        self.end, self.finished = None, False

    def follow(self):
        """Run until the incumbent is settled or nothing is left to try.

        ``end`` is the last usable relaxation, ``finished`` whether it is that of the last eps.
        """
        stage = _Stage(0, self._start, self._options.eps_init)
        while stage is not None:
            self.run.eps = stage.eps
            carried = stage.duals if stage.eps <= CARRIED * ROUND_OFF else None
            relaxed = self._steps.relax(self._forms[stage.form], stage.w, stage.eps, carried, self._budget(carried))
            self._steps.keep_least_infeasible(relaxed.w)
            stage = self._next(stage, relaxed) if self._steps.usable(relaxed) else self._recover(stage, relaxed)

    def _budget(self, carried):
        """Iterations of a relaxation; None, for all that the solver has, where it starts from afar or the user has set them."""
        return None if carried is None or 'max_iter' in self._options.nlp_options else self._options.relaxation_iterations

    def restore(self, w):
        """The nearest point that the feasibility phase finds, with pairs as loose as at the start."""
        return self._steps.restore(w, self._options.eps_init).w

    def _recover(self, stage, relaxed):
        """The next step of the recovery ladder; None at its end, or where a certified incumbent makes it idle."""
        self.finished = False
        self._after(self.run)
        if not self._ladder or self._certified():
            return None
        step, options = self._ladder.pop(0), self._options
        self._steps.note(step.what, relaxed.w)
        self._gap.restart()
        if step.other_form and self._c.widen() and self._branches is not None:
            self._branches.forget()
        eps = max(step.eps(options.eps_init, stage.eps, options.eps_factor), options.eps_final)
        return _Stage((stage.form + step.other_form) % len(self._forms), step.start(self._start, relaxed.w, self), eps)

    def _next(self, stage, relaxed):
        """Explore what the relaxation shows; the stage after it, or None."""
        self.end, options = relaxed, self._options
        at = self._c.evaluate(relaxed.w)
        product = float(np.max(at.G * at.H, initial=0.0))
        sets = active_sets(at.G, at.H, self._steps.biactive(at))
        self._gap.add(stage.eps, at.f)
        self.finished = last = stage.eps <= options.eps_final * ROUND_OFF
        exhausted = product <= EXHAUSTED and sets.same_sides(stage.sets)
        ripe = self._branches is not None and (last or self._telling(stage, sets))
        named = self._branches.explore(relaxed, sets, last or exhausted) if ripe else None
        self._after(self.run)
        if ripe and self._certified() and (self._gap.closed(self.run.point.f) or self._again(stage.named, named)):
            return None
        if last or (exhausted and ripe and self._branches.tried(sets.zero)):
            return self._other_form(stage, relaxed)
        # nothing changes before eps falls below the largest product
        eps = max(min(stage.eps, product) * options.eps_factor, options.eps_final)
        return _Stage(stage.form, relaxed.w, eps, relaxed, sets, named)

    def _telling(self, stage, sets):
        """Whether the active sets are worth a branch NLP."""
        undecided = np.count_nonzero(sets.gamma)
        late = stage.eps <= TELLING * ROUND_OFF and undecided <= UNDECIDED * len(sets.gamma)
        return late or not undecided or sets.same_sides(stage.sets)

    def _again(self, before, now):
        """Whether two relaxations in a row have named the incumbent, or what is as good."""
        best = self.run.point.f
        same = self._options.gap_tol * abs(best)
        return None not in (before, now) and max(before, now) - best <= same

    def _other_form(self, stage, relaxed):
        """Where a path ends with nothing feasible: the same with wider bounds, then the other form."""
        if self._branches is None or self.run.point is not None:
            return None
        wider = self._c.widen()
        form = stage.form + (not wider)
        if form == len(self._forms):
            return None
        self._steps.note("nothing feasible on this path, " + ("shorter elements" if wider else "other form"), relaxed.w)
        self._gap.restart()
        self._branches.forget()
        return _Stage(form, self._start, self._options.eps_init)

    def _certified(self):
        return self.run.point is not None and self.run.point.certificate.certified
