"""The path of relaxations Reg(eps), from which branches are explored (theory, section 4).

As soon as the active sets of a relaxation look settled, the branch NLP that they name is solved.  The path goes on while its
objective promises less than the incumbent's (gap test), and eps may rise again when a relaxation fails.
"""

from dataclasses import dataclass

import numpy as np

from pyomo_fesd.mpcc.active_set import ActiveSets, active_sets
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.mpcc.recovery import LADDER
from pyomo_fesd.mpcc.stationarity import Stationarity

#: For each path the form of its first relaxation and that of the others, without an objective and with one.  The elastic form is by
#: far the quickest; Scholtes' at the first eps puts every pair in the middle, whatever the size of the objective.  The next path
#: is for what the one before does not settle.
AUTO = {
    False: (('elastic', 'elastic'), ('scholtes', 'scholtes')),
    True: (('elastic', 'elastic'), ('scholtes', 'elastic'), ('scholtes', 'scholtes')),
}
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
    """The next relaxation: its path, where it starts, and the form and the result of the one before, with what it has shown."""

    path: int
    w: np.ndarray
    eps: float
    before: str = None
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
        self._paths = AUTO[compiled.has_objective] if options.relaxation == 'auto' else ((options.relaxation,) * 2,)
        self._ladder = list(LADDER)
        self.end, self.finished = None, False

    def follow(self):
        """Run until the incumbent is settled or nothing is left to try.

        ``end`` is the last usable relaxation, ``finished`` whether it is that of the last eps.
        """
        stage = _Stage(0, self._start, self._options.eps_init)
        while stage is not None:
            self.run.eps = stage.eps
            form = self._form(stage)
            carried = stage.duals if stage.eps <= CARRIED * ROUND_OFF and stage.before == form else None
            relaxed = self._steps.relax(form, stage.w, stage.eps, carried, self._budget(stage, carried))
            self._steps.keep_least_infeasible(relaxed.w)
            stage = self._next(stage, relaxed) if self._steps.usable(relaxed) else self._recover(stage, relaxed)

    def _form(self, stage):
        first, later = self._paths[stage.path]
        return first if stage.before is None else later

    def _budget(self, stage, carried):
        """Iterations of a relaxation; None, for all that the solver has, where it starts from afar on the last path, or the user
        has set them.
        """
        afar = carried is None and stage.path + 1 == len(self._paths)
        return None if afar or 'max_iter' in self._options.nlp_options else self._options.relaxation_iterations

    def restore(self, w):
        """The nearest point that the feasibility phase finds, with pairs as loose as at the start."""
        return self._steps.restore(w, self._options.eps_init).w

    def _recover(self, stage, relaxed):
        """The next step of the recovery ladder; None at its end, or where a certified incumbent makes it idle."""
        self.finished = False
        self._after(self.run)
        if not self._ladder or self._certified():
            return None
        if self._fails_at_once(stage):
            return self._begin(stage.path + 1, "start again, other form", relaxed)
        step, options = self._ladder.pop(0), self._options
        self._steps.note(step.what, relaxed.w)
        self._gap.restart()
        if step.other_form and self._c.widen() and self._branches is not None:
            self._branches.forget()
        eps = max(step.eps(options.eps_init, stage.eps, options.eps_factor), options.eps_final)
        return _Stage((stage.path + step.other_form) % len(self._paths), step.start(self._start, relaxed.w, self), eps)

    def _fails_at_once(self, stage):
        """Whether a path ends where it begins: there is nothing to go back to, and the forms differ most at their first eps."""
        first = stage.before is None and len(self._ladder) == len(LADDER)
        return first and self._branches is not None and stage.path + 1 < len(self._paths)

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
        return _Stage(stage.path, relaxed.w, eps, self._form(stage), relaxed, sets, named)

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
        """Where a path ends with nothing certified: the same with shorter elements if they may be missing, then the next path."""
        if self._branches is None:
            return None
        if self.run.point is not None and not self._certified():
            # the least length may keep a switch from a boundary of a stage that a branch beside carries it over
            self._branches.move()
        if self._certified():
            return None
        wider = self._short_of_lengths() and self._c.widen()
        path = stage.path + (not wider)
        if path == len(self._paths):
            return None
        return self._begin(path, "nothing certified on this path, " + ("shorter elements" if wider else "other form"), relaxed)

    def _begin(self, path, why, relaxed):
        """The first stage of another path."""
        self._steps.note(why, relaxed.w)
        self._gap.restart()
        self._branches.forget()
        return _Stage(path, self._start, self._options.eps_init)

    def _short_of_lengths(self):
        """Whether there is nothing feasible, or what only a bound of the method keeps from descending."""
        return self.run.point is None or self.run.point.certificate.grade is Stationarity.LIMITED

    def _certified(self):
        return self.run.point is not None and self.run.point.certificate.certified
