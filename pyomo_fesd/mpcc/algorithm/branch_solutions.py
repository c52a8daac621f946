"""Solutions of branch NLPs: in one NLP, or in two where pairs are to be decided (eq. 13), with the certificate of the LPEC.

Takes: values near a branch and its zero sides.
Leaves: a ``Point``; None where the branch has no solution.
"""

from collections import defaultdict
from dataclasses import dataclass
from operator import attrgetter
from typing import Optional

import numpy as np

from pyomo_fesd.mpcc.algorithm.state import Outcome, Point, Stop
from pyomo_fesd.mpcc.algorithm.subsolves import LEFT
from pyomo_fesd.mpcc.nlp import NlpResult, Stall
from pyomo_fesd.mpcc.subproblems import Stationarity

#: Iterations of the first and of the second attempt; and how many more if they only lead to a feasible point (None: no limit).
FIRST, SECOND = 30, 100
MORE = {FIRST: SECOND, SECOND: None}
#: Times that a branch with the decisions of its sides is solved again with those that its solution asks for.
ASKED = 2
#: A failed attempt came near if it leaves a violation of the rows below this, or has reduced it to this part.
NEAR, NEARER = 1e-2, 0.1
#: A branch with decisions of its sides that leaves a violation below this may be one that places of least extent make infeasible:
#: they are 1e-6 of a usual extent, and what is equal at both of their ends differs by as much.
ALMOST = 1e-5
#: A more even solution may cost this much more, relative: the error of uneven elements, not another minimum.
AS_GOOD = 1e-4
#: One without places of least extent may cost this much more: the error of uneven ones, of any order.
UNEVEN = 2e-2
#: A branch that is to be below another objective is left where multipliers stay above this, relative to that: where it has a
#: solution at all, a violation of 1e-4 is worth a tenth of the objective there.
STEEP = 1e3
#: A branch with decisions of its sides is left where its violation does not halve in so many iterations: in two runs (a ball and
#: discs) that would have saved a third of all iterations, and stopped 8 NLPs that ended solved.
STALL = 50
#: An attempt with a limit of iterations, or the one from afar after it, is left where the violation is within the tolerance and
#: does not halve in so many: rows contradict each other by less than the tolerance (pack-rig1-32 of MacMPEC: 4 NLPs, not 13, and
#: the same minimum).
CONTRADICTING = 10
#: Two solutions are one if their values, relative or absolute, and their objectives, relative, differ by less: branches that meet
#: there lead to it again and again, and a certificate may take longer than all their NLPs.
SAME_VALUE, SAME_OBJECTIVE = 1e-5, 1e-9
#: Round-off of an NLP's end shows no descent in an LPEC that is as large as this.
CLEAR_DESCENT = 1e-4
#: A feasible point with variables beyond this and an objective below that of the start shows an unbounded problem; with another
#: one it came from an unbounded relaxation.
UNBOUNDED = 1e15


@dataclass
class _Solution:
    """What the NLPs of a branch have found; its certificate is made when it is first needed.

    ``f`` is the objective, infinite without a solution.  A branch ``is_left`` after the first NLP, whose objective this is then, if
    that is clearly above another one.
    """

    f: float = np.inf
    is_left: bool = False
    nlp: Optional[NlpResult] = None
    equal: object = None
    certificate: object = None


class BranchSolutions:
    """The solutions of the branches of one run.

    Parameters
    ----------
    subsolves : Subsolves
        their NLPs
    at_once : bool
        whether a branch is first solved with the decisions that its sides ask for: without any, places of an objective that is
        large beside the penalty shrink to nothing

    Attributes
    ----------
    at_once : bool
        False without pairs to decide
    """

    def __init__(self, subsolves, at_once=False):
        self._c, self._tolerances, self._subsolves = subsolves.compiled, subsolves.tolerances, subsolves
        self.at_once, self._known, self._certified = at_once and self._c.eta.numel() > 0, {}, defaultdict(list)
        self._failed = {}

    def certified(self, w, zero, duals=None, below=np.inf, enough=np.inf, **more):
        """The certified solution of a branch; None if it has none, or if its objective is clearly not ``below`` another one.

        One that is above ``enough`` does not count either: its LPEC may take longer than all NLPs, and its answer would not matter.
        From the same values the same branch is solved once, whatever the names of its sides before they are settled: neighbours of
        points that hardly differ lead to it again and again.
        """
        if duals is not None or 'box' in more:
            return self._point(self._solution(w, zero, duals, below, **more), below, enough)
        start = self._subsolves.on_sides(w, zero)
        if start is None:
            return None
        key = hash((start.tobytes(), self._subsolves.settled(w, zero).tobytes(), self._bounds(), *sorted(more.items())))
        found = self._known.get(key)
        if found is None or (found.is_left and not _is_clearly_above(found.f, below)):
            self._known[key] = found = self._solution(w, zero, duals, below, **more)
        return self._point(found, below, enough)

    def failed(self, zero, most):
        """The end of the NLP of a branch that has failed and left a violation of at most ``most``; None if there is none."""
        end = self._failed.get(zero.tobytes())
        return None if end is None or self._subsolves.violation(end.w) > most else end

    def up_to(self, enough, suits=lambda f, w: True):
        """Yield the certified ones of the solutions found so far that suit and are at most ``enough``, the best first."""
        found = [one for one in self._known.values() if one.nlp is not None and one.f <= enough and suits(one.f, one.nlp.w)]
        points = (self._point(one, np.inf, np.inf) for one in sorted(found, key=attrgetter('f')))
        return (point for point in points if point is not None and point.certificate.certified)

    def onward(self, point, zero, enough):
        """The certified solution of a branch from ``point``; None without one of at most ``enough``.

        It has the decisions in force at the point, with which the LPEC found its direction.
        """
        equal = self._subsolves.in_force(point.w, point.equal)
        solved, equal = self._with_all(self._subsolves.branch(point.w, zero, equal, 0.0, stalls=self._stalls()), zero, equal)
        return None if solved is None else self._point(self._measured(_Solution(nlp=solved, equal=equal)), np.inf, enough)

    def _with_all(self, solved, zero, equal, left=ASKED, **more):
        """A solution with the decisions ``equal``, and solved again with those that it asks for as well; none that still asks."""
        if solved is None:
            return None, None
        asked = self._subsolves.asked(solved.w, zero) & ~equal
        if not asked.any():
            return solved, equal
        if not left:
            return None, None
        again = self._subsolves.branch(solved.w, zero, equal | asked, 0.0, **more | {'duals': solved})
        return self._with_all(again, zero, equal | asked, left - 1, **more)

    def _point(self, found, below, enough):
        if found.nlp is None or _is_clearly_above(found.f, below) or found.f > enough:
            return None
        if found.certificate is None:
            found = self._certified_before(found) or self._certify(found)
        return Point(found.nlp, found.f, found.certificate, found.equal) if found.certificate.feasible else None

    def _certify(self, found):
        found.certificate = self._subsolves.certify(found.nlp, found.equal)
        self._certified[self._bounds()].append(found)
        return found

    def _certified_before(self, found):
        """The same solution with its certificate, from another branch within the same bounds; None if it is new.

        One of which the LPEC found a descent that may be round-off is certified anew.
        """
        known = self._certified[self._bounds()]
        return next((one for one in known if _is_clear(one.certificate) and _is_same(one, found)), None)

    def _bounds(self):
        """The present bounds of the variables: without guide bounds, or with an extent of 0, another problem is solved."""
        return hash((self._c.lbx.tobytes(), self._c.ubx.tobytes()))

    def _solution(self, w, zero, duals, below, **more):
        more |= {'steepest': STEEP * max(1.0, abs(below)), 'stalls': self._stalls(**more)}
        found = self._solve(w, zero, duals, below, **more)
        if found.nlp is not None and not found.nlp.solved and more.get('max_iter') in MORE:
            # feasible, so the branch has a solution, but not at its minimum yet
            more |= {'max_iter': MORE[more['max_iter']]}
            again = self._solve(found.nlp.w, zero, found.nlp, below, **more | {'stalls': self._stalls(**more)})
            found = found if again.nlp is None else again
        return found if found.nlp is None else self._measured(found)

    def _stalls(self, max_iter=None, **more):
        """How the violation has to shrink; rows of the last attempt, and of a model without sides, may be ill-scaled."""
        of_rows = [Stall(CONTRADICTING, self._tolerances.feasibility)] if self._c.pairs and max_iter is not None else []
        return of_rows + [Stall(STALL)] * self.at_once

    def _measured(self, found):
        """The solution with its objective, and what that owes to violated rows; none where it shows no minimum."""
        if self.at_once and not found.nlp.solved and self._subsolves.violation(found.nlp.w) > LEFT:
            # places of least extent hide it where rows contradict each other, and nothing leads on from there
            return _Solution()
        found.f = self._c.evaluate(found.nlp.w).f
        if np.abs(found.nlp.w).max(initial=0.0) > UNBOUNDED:
            if found.f < self._c.evaluate(self._c.x0).f:
                raise Stop(Outcome.UNBOUNDED)
            return _Solution()
        found.f += self._owed(found.nlp)
        return found

    def _owed(self, solved):
        """What the objective owes to violated rows, by their multipliers: no progress, though the rows hold to the tolerances."""
        rows, _ = self._c.violations(solved.w)
        return float(np.abs(solved.lam_g[: len(rows)]) @ rows)

    def _solve(self, w, zero, duals, below, **more):
        """Two NLPs where pairs are to be decided (eq. 13): with the penalty to find eta, then with the constraints in force.

        With ``at_once`` the sides of the branch decide, before the first one.
        """
        if self.at_once:
            solved, equal = self._decided_by_sides(w, zero, duals=duals, **more)
            return _Solution(nlp=solved, equal=equal)
        first = self._subsolves.attempt(w, zero, None, 1.0, duals=duals, **more)
        if first is not None and not self._subsolves.usable(first):
            asked = self._subsolves.asked(w, zero) if self._c.eta.numel() else None
            solved, equal = (None, None) if asked is None else self._decided_from_afar(w, zero, asked, first, **more)
        elif first is not None and first.solved and _is_clearly_above(self._c.evaluate(first.w).f, below):
            return _Solution(self._c.evaluate(first.w).f, is_left=True)
        else:
            solved, equal = self.decided(first, zero, **more)
        return _Solution(nlp=solved, equal=equal)

    def _decided_by_sides(self, w, zero, **more):
        """The NLP of a branch with the decisions that its sides ask for, from nearby, then from afar."""
        equal = self._subsolves.asked(w, zero)
        first = None if equal is None else self._subsolves.attempt(w, zero, equal, 0.0, **more)
        if first is None:
            return None, None
        if self._subsolves.usable(first):
            return self._with_all(first, zero, equal, **more)
        self._failed[zero.tobytes()] = first
        return self._decided_from_afar(w, zero, equal, first, **more)

    def _decided_from_afar(self, w, zero, equal, first, **more):
        """One NLP with the decisions ``equal`` that the sides of the branch ask for, after an attempt ``first`` that came near.

        Without decisions places without a change may shrink to nothing, and the equations of what they hold lose their rank.
        """
        at_sides = self._subsolves.on_sides(w, zero)
        if self._subsolves.violation(first.w) > max(NEAR, NEARER * self._subsolves.violation(at_sides)):
            return None, None
        more |= {'max_iter': None, 'duals': None}
        return self._with_all(self._subsolves.branch(w, zero, equal, 0.0, far=True, **more), zero, equal, far=True, **more)

    def decided(self, first, zero, apart=False, **more):
        """The second NLP, after the solution ``first`` of a branch, and the decisions in force; none of ``apart``."""
        if first is None or not self._c.eta.numel():
            return first, None
        return self.imposed(first.w, zero, ~np.asarray(apart), self._subsolves.branch, duals=first, **more)

    def beside(self, w, **more):
        """The result, usable or not, of the branch NLP that ``w`` names with the decisions in force there, and these.

        ``w`` is exactly complementary, and its decisions hold.  None if the bounds of the branch contradict each other.
        """
        zero = self._subsolves.sets(w, self._tolerances.biactive).zero
        return self.imposed(w, zero, True, self._subsolves.attempt, stalls=self._stalls(**more), **more)

    def imposed(self, w, zero, among, solve, **more):
        """A branch NLP from ``w`` with the decisions that its eta asks for, ``among`` some; a tentative one only if it can be."""
        equal = (self._c.evaluate(w).eta > self._tolerances.eta) & among
        solved = solve(w, zero, equal, 0.0, **more)
        if not (solved and self._subsolves.usable(solved)) and np.any(equal & self._c.tentative):
            equal = equal & ~self._c.tentative
            solved = solve(w, zero, equal, 0.0, **more)
        return solved, equal


def _is_clear(certificate):
    """Whether the LPEC would say the same of values that differ by round-off."""
    return certificate.grade is not Stationarity.DESCENT or certificate.lpec.descent > CLEAR_DESCENT


def _is_same(one, other):
    return have_same_values(one, other) and np.array_equal(one.equal, other.equal)


def have_same_values(one, other, columns=slice(None)) -> bool:
    """Return whether two solutions of branches are one by their objectives and the values in some ``columns``."""
    if not (one.nlp.solved and other.nlp.solved) or abs(one.f - other.f) > SAME_OBJECTIVE * max(1.0, abs(one.f)):
        return False
    a, b = one.nlp.w[columns], other.nlp.w[columns]
    return bool((np.abs(a - b) <= SAME_VALUE * np.maximum(1.0, np.abs(a))).all())


def one_of(known, point, columns):
    """Return the one of ``known`` solutions that ``point`` is again, by the values in some columns; None if it is new."""
    return next((one for one in known if have_same_values(one, point, columns)), None)


def _is_clearly_above(f, below):
    return f > below + AS_GOOD * max(1.0, abs(below))


def as_good(point, lowest):
    """Return the largest objective of a certified point that may take the place of ``point``.

    It is that of the ``lowest`` point of the run, if there is one, that counts: one point a little dearer than the one before would
    lead up step by step.
    """
    f = point.f if lowest is None else min(point.f, lowest.f)
    return f + UNEVEN * max(1.0, abs(f))
