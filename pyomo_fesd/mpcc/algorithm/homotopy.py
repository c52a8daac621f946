"""The path of relaxations Reg(eps), from which branches are explored (theory, section 4).

As soon as the active sets of a relaxation look settled, the branch NLP that they name is solved.  The path goes on while its
objective promises less than the incumbent's (gap test), and eps may rise again when a relaxation fails.
"""

from dataclasses import dataclass, replace

import numpy as np

from pyomo_fesd.mpcc.algorithm.neighbours import AT_BOUND
from pyomo_fesd.mpcc.algorithm.recovery import RECOVERIES
from pyomo_fesd.mpcc.algorithm.search import Verdict
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.mpcc.subproblems import ActiveSets, Stationarity

#: For each path the form of its first relaxation and that of the others, without an objective and with one.  The elastic form is by
#: far the quickest; Scholtes' at the first eps puts every pair in the middle, whatever the size of the objective.  The next path
#: is for problems that the one before does not settle.
AUTO = {
    False: (('elastic', 'elastic'), ('scholtes', 'scholtes')),
    True: (('elastic', 'elastic'), ('scholtes', 'elastic'), ('scholtes', 'scholtes')),
}
#: Beside impacts a second elastic path begins at this part of the first eps.  Where a penalty leads up, from one late relaxation to
#: the next by more than the other number, relative, and no branch has a solution, it begins at once: such a path ends high and late
#: (a hopper whose relaxations rose from 7 to 20 had its first point after 65 s).
FIRMER, RISE = 0.1, 0.25
#: From this eps on multipliers are kept as a start; before, Ipopt's own centring finds better minima (a car: 13.3, not 16).
WITH_MULTIPLIERS = 1e-2
#: From this eps on a relaxation is worth a branch NLP, which is much cheaper than the next relaxation, unless more than this part
#: of the pairs is undecided.
LATE, UNDECIDED = 1e-3, 0.5
#: So is one with products below this: the elastic form ends near a solution already at its first eps.
NEARLY = 1e-6
#: With products below this Newton's method may find the branch's solution at once, which costs next to nothing.
NEARBY = 1e-2
#: With products below this and the same active sides as before, a smaller eps changes nothing.
EXHAUSTED = 1e-8
#: Products of eps_factor carry round-off.
ROUND_OFF = 1.001


@dataclass(frozen=True)
class _Position:
    """A position: the path's number, start and eps; form, result and active sets of the relaxation before, and the objective of
    the branch that they named; whether the relaxation goes on from where its budget of iterations ended.
    """

    path: int
    w: np.ndarray
    eps: float
    form: str = None
    duals: NlpResult = None
    sets: ActiveSets = None
    named: float = None
    goes_on: bool = False


class Homotopy:
    """One run along the path.

    Parameters
    ----------
    setup : Setup
    subsolves : Subsolves
    gap : GapTest
    branches : Branches or None
        explores branches; with None the path is followed to its end
    start : array
        where the path begins

    Attributes
    ----------
    end : NlpResult or None
        the last usable relaxation
    finished : bool
        whether ``end`` is the relaxation of the last eps
    """

    def __init__(self, setup, subsolves, gap, branches, start):
        self._c, self._options, self._after = setup.compiled, setup.options, setup.after
        self._subsolves, self._gap, self._branches, self._start, self.run = subsolves, gap, branches, start, subsolves.run
        form = self._options.relaxation
        self._paths = [(1.0, *forms) for forms in (AUTO[self._c.has_objective] if form == 'auto' else ((form,) * 2,))]
        if self._c.impacts and self._c.has_objective and form == 'auto':
            self._paths.insert(1, (FIRMER, *AUTO[True][0]))
        self._recoveries = list(RECOVERIES)
        self._position, self._cold = _Position(0, start, self._options.eps_init), {}
        self.end, self.finished = None, False

    def follow(self, patience=None):
        """Run until the incumbent is settled or nothing is left to try.

        After the Deadline ``patience`` it pauses while there is no feasible point; the next call goes on.
        """
        while self._position is not None and not (patience is not None and patience.expired() and self.run.point is None):
            self.run.eps = self._position.eps
            relaxed = self._relax(self._position)
            self._subsolves.keep_least_infeasible(relaxed.w)
            step = self._next if self._is_on_the_path(relaxed) else self._recover
            self._position = step(self._position, relaxed)

    def _is_on_the_path(self, relaxed):
        """Whether a relaxation can be gone on from: usable, and beside impacts not stopped where its products are still above eps.

        The rows of an elastic one hold whatever its slack is.
        """
        has_left = self._c.impacts and relaxed.stopped and self._largest_product(relaxed.w) > self._position.eps * ROUND_OFF
        return self._subsolves.usable(relaxed) and not has_left

    def _largest_product(self, w):
        at = self._c.evaluate(w)
        return float(np.max(at.G * at.H, initial=0.0))

    def _relax(self, position):
        form, duals = self._form(position), self._duals(position)
        budget = None if self._unlimited(position) else self._options.relaxation_iterations
        if duals is not None or len(self._paths) == 1:
            return self._subsolves.relax(form, position.w, position.eps, duals, budget)
        # two paths may begin with the same form: the same NLP has the same end
        key = form, position.eps, position.w.tobytes(), self._c.lbx.tobytes()
        known = self._cold.get(key)
        if known is None or known.stopped:
            self._cold[key] = known = self._subsolves.relax(form, position.w, position.eps, None, budget)
        return known

    def _duals(self, position):
        """The multipliers to start from, or None."""
        late = position.eps <= WITH_MULTIPLIERS * ROUND_OFF
        return position.duals if late and position.form == self._form(position) and not position.goes_on else None

    def _unlimited(self, position):
        """All iterations of the solver for a cold start on the last path, or where the user has set their number."""
        last_cold = self._duals(position) is None and position.path + 1 == len(self._paths)
        return last_cold or 'max_iter' in self._options.nlp_options

    def _form(self, position):
        _, first, later = self._paths[position.path]
        return first if position.form is None else later

    def restored(self, w):
        """The nearest point that the restoration finds, with pairs as loose as at the start."""
        return self._subsolves.restore(w, self._options.eps_init).w

    def _recover(self, position, relaxed):
        """The position after a relaxation that failed; None after the last recovery, or with a certified incumbent."""
        self.finished = False
        self._after(self.run)
        if self._certified():
            return None
        if relaxed.stopped and not position.goes_on and not self._unlimited(position):
            # Ipopt's own centring finds its way again where its iterations have led
            self._subsolves.note("go on", relaxed.w)
            return replace(position, w=relaxed.w, goes_on=True)
        if self._fails_at_once(position):
            return self._begin(self._other_form(position.path), "start again, other form", relaxed)
        if not self._recoveries or self._hopeless():
            return None
        recovery, options = self._recoveries.pop(0), self._options
        self._subsolves.note(recovery.note, relaxed.w)
        self._gap.restart()
        if recovery.other_form and self._c.widen() and self._branches is not None:
            self._branches.attempts.forget()
        eps = max(recovery.eps(options.eps_init, position.eps, options.eps_factor), options.eps_final)
        path = self._other_form(position.path) % len(self._paths) if recovery.other_form else position.path
        return _Position(path, recovery.start(self._start, relaxed.w, self), eps)

    def _fails_at_once(self, position):
        """Whether a path fails at its first relaxation: there is no earlier one, and the forms differ most at their first eps."""
        first = position.form is None and len(self._recoveries) == len(RECOVERIES)
        return first and self._branches is not None and position.path + 1 < len(self._paths)

    def _other_form(self, path):
        """The next path that begins with another form than ``path``, or just the next one."""
        forms = [first for _, first, _ in self._paths]
        return next((k for k in range(path + 1, len(forms)) if forms[k] != forms[path]), path + 1)

    def _next(self, position, relaxed):
        """Explore the branch that the relaxation names; the position after it, or None."""
        self.end, options = relaxed, self._options
        at, product = self._c.evaluate(relaxed.w), self._largest_product(relaxed.w)
        sets = self._subsolves.sets(relaxed.w, self._subsolves.biactive(at))
        self._gap.add(position.eps, at.f)
        self.finished = position.eps <= options.eps_final * ROUND_OFF
        exhausted = product <= EXHAUSTED and sets.same_sides(position.sets)
        explores = self._worth_a_branch(position, sets, product)
        named = self._branches.explore(relaxed, sets, self.finished or exhausted) if explores else None
        nearby = self._branches is not None and not explores and product <= NEARBY
        if nearby:
            self._branches.explore_nearby(relaxed, sets)
        self._after(self.run)
        if (explores or nearby) and self._settled(position.named, named):
            return None
        if self._leads_up(position, at.f):
            return self._begin(position.path + 1, "leads up, start again", relaxed)
        if self._promises_nothing() or self.finished or (exhausted and explores and self._branches.attempts.tried(sets.zero)):
            return self._other_path(position, relaxed)
        # no change before eps falls below the largest product
        eps = max(min(position.eps, product) * options.eps_factor, options.eps_final)
        return _Position(position.path, relaxed.w, eps, self._form(position), relaxed, sets, named)

    def _leads_up(self, position, f):
        """Whether a path beside impacts has no feasible point, and a late relaxation is far above the one before it."""
        is_late = position.eps <= LATE * ROUND_OFF and self._c.impacts and self._branches is not None
        if not is_late or position.duals is None or self.run.point is not None or position.path + 1 == len(self._paths):
            return False
        before = self._c.evaluate(position.duals.w).f
        return f - before > RISE * abs(before)

    def _worth_a_branch(self, position, sets, product):
        """Whether the active sets are clear enough for a branch NLP, or the last ones."""
        if self._branches is None:
            return False
        undecided = np.count_nonzero(sets.gamma)
        late = (position.eps <= LATE * ROUND_OFF or product <= NEARLY) and undecided <= UNDECIDED * len(sets.gamma)
        return self.finished or late or not undecided or sets.same_sides(position.sets)

    def _settled(self, before, now):
        """Whether the incumbent is certified, and closes the gap or is as good as the branches of the last two relaxations."""
        if not self._certified():
            return False
        best = self.run.point.f
        if self._gap.closed(best):
            return True
        return None not in (before, now) and self._gap.same(max(before, now), best)

    def _promises_nothing(self):
        """Whether the incumbent is nearly as good as the path promises: beside impacts smaller eps only lead to worse points."""
        return bool(self._c.impacts) and self.run.point is not None and self._gap.nearly_closed(self.run.point.f)

    def _other_path(self, position, relaxed):
        """After a path without a certified point: the same path with wider bounds if they were missing, else the next one."""
        if self._branches is None:
            return None
        if self.run.point is not None and not self._certified():
            # no small step may reach a better branch from here, but a neighbouring one may be
            self._branches.try_neighbours()
        if self._certified() or self._hopeless():
            return None
        wider = (self.run.point is None or self._is_limited()) and self._c.widen()
        if wider and self.run.point is not None:
            self._branches.release()
            if self._certified():
                return None
        again = wider and self._bounds_matter(position, relaxed.w)
        path = position.path + (not again)
        if path == len(self._paths):
            return None
        return self._begin(path, "nothing certified on this path, " + ("wider bounds" if again else "other form"), relaxed)

    def _bounds_matter(self, position, w):
        """Whether a path that ends at ``w`` is repeated without guide bounds: what they do not hold would end there again."""
        is_held = bool((w[self._c.guided] < self._c.guide_lbx[self._c.guided] + AT_BOUND).any())
        return is_held or self.run.point is not None or position.path + 1 == len(self._paths)

    def _begin(self, path, why, relaxed):
        """The first position of another path."""
        self._subsolves.note(why, relaxed.w)
        self._gap.restart()
        self._branches.attempts.forget()
        return _Position(path, self._start, max(self._paths[path][0] * self._options.eps_init, self._options.eps_final))

    def _is_limited(self):
        """Whether only guide bounds keep the incumbent from descending."""
        return self.run.point.certificate.grade is Stationarity.LIMITED

    def _hopeless(self):
        """Whether nothing feasible was found, and no branch of so few pairs has a feasible point from the start."""
        return self.run.point is None and self._branches is not None and self._branches.exhaust(self._start) is Verdict.NONE

    def _certified(self):
        return self.run.point is not None and self.run.point.certificate.certified
