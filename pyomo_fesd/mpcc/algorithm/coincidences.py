"""Coinciding changes: every order of them is tried before a point counts as certified.

In the incumbent the branches of all orders meet, but none of them is beside it for the LPEC: the place between two changes has no
extent there.  One is inserted (``insertions``).  Where that does not settle an order, the incumbent is solved once more with a
spare place, of extent zero.  If the linearised problem of that branch descends, the place grows and leads to a better point; if it
does not, the order is settled.  A point with any other order is not certified.  Changes at an end of a row of places coincide with
the end (``arrivals``).
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations

import numpy as np

from pyomo_fesd.mpcc.algorithm.arrivals import Entered, branches
from pyomo_fesd.mpcc.algorithm.branch_solutions import AS_GOOD, SECOND
from pyomo_fesd.mpcc.algorithm.branches import PROGRESS
from pyomo_fesd.mpcc.algorithm.insertions import OrdersByInsertion
from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.algorithm.subsolves import INFEASIBLE
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.mpcc.subproblems import G_ZERO, ActiveSets, Stationarity, Verdict

#: Iterations enough to show that there is no branch of an order.
PATIENCE = 300
#: A place nearer to its least extent than this may be none: NLP solvers leave it a little above its bound.
NEAR_BOUND = 1e-4
#: Places that come in at an end at a time.
AT_END = 2
#: Outcomes of an order: it leads to no better point; that could not be shown; or no branch on this grid contains the incumbent.
SETTLED, OPEN, ABSENT = 'settled', 'open', 'absent'


@dataclass(frozen=True)
class _Order:
    """An order of changes: equivalent ways to it, and functions that return the ``Verdict`` of an inserted place.

    ``place`` is what the inserted place holds; None for one of several changes at an end of a row.
    """

    ways: list
    judges: list
    place: '_Inserted | _AtEnd | None' = None

    @property
    def key(self):
        """Equal for orders with the same branches and the same place; None without a branch."""
        ways = tuple((way.extents.tobytes(), way.zero.tobytes()) for way in self.ways)
        return (self.place, ways) if ways else None


@dataclass(frozen=True)
class _Inserted:
    """What a place inserted at a coincidence holds.

    ``happened`` are the numbers of the changes that have happened there, and ``side`` is 0 before a boundary that stays where it
    is, 1 behind it or where there is none.
    """

    coincidence: object
    side: int
    happened: frozenset

    @classmethod
    def of(cls, coincidence, side, changes):
        """The place in which ``changes`` have happened."""
        return cls(coincidence, side, frozenset(map(coincidence.changes.index, changes)))

    def precedes(self, other):
        """Whether the other can follow it: one more place of the same coincidence, with no change undone."""
        if self == other or self.coincidence is not other.coincidence or self.side > other.side:
            return False
        return self.happened <= other.happened


@dataclass(frozen=True)
class _AtEnd:
    """What a place at an end of a row holds: the change of one system."""

    row: int
    system: int


class Coincidences:
    """The coincidences of one run.

    Parameters
    ----------
    subsolves : Subsolves
    branches : Branches
    """

    def __init__(self, subsolves, branches):
        self._c, self._tolerances, self.run = subsolves.compiled, subsolves.tolerances, subsolves.run
        self._subsolves, self._branches, self._settled = subsolves, branches, None

    def settle(self):
        """Try all orders of the incumbent, and of each better point found; mark it if one remains open."""
        while self.run.point is not None and self.run.point.certificate.certified and self._c.has_objective:
            before = self.run.point
            # until all orders are settled any certified point is better
            self.run.point = replace(before, certificate=replace(before.certificate, grade=Stationarity.OPEN))
            found = self._outcome(before)
            if found is SETTLED:
                self.run.point = self._settled = before
            elif found is not OPEN:
                self._branches.improve_from(found, True)
                if not self.run.point.certificate.certified:
                    # a better point may have changes that leave at the other end, or beside a place at its lower bound
                    self._branches.try_neighbours()
            if found in (SETTLED, OPEN):
                return

    def mark_untried(self):
        """Mark the incumbent as open if it is certified, and has orders that were not tried as a limit came before."""
        point = self.run.point
        if point is not None and point.certificate.certified and point is not self._settled and self._may_have_orders(point):
            self.run.point = replace(point, certificate=replace(point.certificate, grade=Stationarity.OPEN))

    def _may_have_orders(self, point):
        if not self._c.has_objective or self._is_flat(point):
            return False
        sets = self._subsolves.sets(point.w, self._tolerances.biactive)
        if self._holds_anything(point.w, sets) or self._branches.has_short(point):
            return True
        return next(self._orders(point, sets), None) is not None

    def checked(self, w, certificate):
        """The certificate of a point that the LPEC has certified, after all orders were tried."""
        if not self._c.has_objective:
            return certificate
        nlp = NlpResult(w, self._c.evaluate(w).f, 'given', 0, np.zeros(0), np.zeros(0))
        found = self._outcome(Point(nlp, nlp.f, certificate))
        if found is SETTLED:
            return certificate
        return replace(certificate, grade=Stationarity.OPEN if found is OPEN else Stationarity.DESCENT)

    def _outcome(self, point):
        """A better point; or whether all orders are settled."""
        tried, outcome = set(), SETTLED
        if self._is_flat(point):
            return SETTLED
        better = self._branches.without_short(point)
        if better is not None:
            return better
        sets = self._subsolves.sets(point.w, self._tolerances.biactive)
        if self._holds_anything(point.w, sets):
            return OPEN
        possible = []
        for order in self._orders(point, sets):
            if order.key is not None and order.key in tried:
                continue
            tried.add(order.key)
            found = self._order(point, order, possible)
            if found is OPEN:
                outcome = OPEN
            elif found is not SETTLED:
                return found
        return OPEN if _follow(possible) else outcome

    def _order(self, point, order, possible):
        """A better point in an order; or its outcome.  What it inserts is appended to ``possible`` if that is possible."""
        verdicts = set()
        for judge in order.judges:
            verdicts.add(judge())
            if verdicts & {Verdict.IMPOSSIBLE, Verdict.NO_DESCENT}:
                break
        if order.place is not None and Verdict.IMPOSSIBLE not in verdicts:
            possible.append(order.place)
        if verdicts & {Verdict.IMPOSSIBLE, Verdict.NO_DESCENT}:
            return SETTLED
        inserts = bool(verdicts - {Verdict.NONE})
        found = self._first(partial(self._try, point, inserts), order.ways)
        if found is SETTLED and Verdict.DESCENT in verdicts:
            # a spare place is known to the tolerances of its NLP only: a slide with rates of round-off seems to have no room
            return OPEN
        if found is ABSENT:
            # that no branch contains the point is no proof, as there may be no place to spare; but where nothing can be inserted
            # there is no other
            return OPEN if inserts else SETTLED
        return found

    def _is_flat(self, point):
        """Whether no direction descends, whatever the constraints."""
        return not self._c.gradients(point.w)[0].any()

    def _holds_anything(self, w, sets):
        """Whether a place of least extent at an end has a bi-active pair: any values would do, and the LPEC takes them for rates.

        Elsewhere the orders are tried as if it were none (``_situations``).
        """
        parts = self._subsolves.parts
        ends = [k for k in range(len(parts.all)) if len(parts.beside(k)) < 2]
        least = [k for k in ends if w[parts.all[k].extent] <= self._c.lbx[parts.all[k].extent] + NEAR_BOUND]
        return bool(len(least)) and bool(np.isin(parts.of_pair[sets.gamma], least).any())

    @staticmethod
    def _first(attempt, ways):
        """The first outcome of equivalent ways that is not open."""
        return next((found for found in (attempt(way) for way in ways) if found is not OPEN), OPEN)

    def _orders(self, point, sets) -> Iterator['_Order']:
        w, inserted = point.w, OrdersByInsertion(self._subsolves, point, sets)
        for coincidence, at in self._situations(w, sets):
            present = [change for change in coincidence.changes if _differs(change, at)]
            for some in _subsets(present, coincidence.fixed):
                rest = [change for change in present if change not in some]
                moved = some if coincidence.fixed else rest
                moves = (inserted.later, some), (inserted.earlier, moved)
                judges = [partial(judge, coincidence, those, present) for judge, those in moves if at is sets]
                later, earlier = _moved(at.zero, [c.later for c in some]), _moved(at.zero, [c.earlier for c in moved])
                later = _way(w, coincidence.later, later, coincidence.by_values_later, coincidence.beyond_later, at)
                earlier = _way(w, coincidence.earlier, earlier, coincidence.by_values_earlier, coincidence.beyond_earlier, at)
                before, after = (_Inserted.of(coincidence, side, happened) for side, happened in enumerate((some, rest)))
                if coincidence.fixed:
                    yield _Order(later, judges[:1], after)
                    yield _Order(earlier, judges[1:], before)
                else:
                    yield _Order(later + earlier, judges, after)
        for entered, changed, alone in branches(self._c, w, sets, self._tolerances.biactive):
            judges = [partial(inserted.entered, entered), partial(inserted.at_end, changed)]
            yield _Order([] if entered is None else [entered], judges, None if alone is None else _AtEnd(*alone))

    def _situations(self, w, sets) -> Iterator[tuple]:
        """Each coincidence with the active sets; also those as if the place beside it, at its lower bound, were none."""
        by_later, by_earlier = ({getattr(c, side): c for c in self._c.coincidences} for side in ('later', 'earlier'))
        for coincidence in self._c.coincidences:
            yield coincidence, sets
            beside = ((coincidence.later, by_earlier, 'earlier'), (coincidence.earlier, by_later, 'later'))
            for variable, others, direction in beside:
                if variable in others and variable is not None and w[variable] <= self._c.lbx[variable] + NEAR_BOUND:
                    zero = _moved(sets.zero, [getattr(change, direction) for change in others[variable].changes])
                    yield coincidence, ActiveSets(zero, np.zeros(len(zero), dtype=bool))

    def _try(self, point, inserts, way):
        """A better point in the branch of a way, in which its places may grow; or the outcome.

        ``inserts`` is whether places can be inserted, so that their values have a limit.
        """
        enough = self._tolerances.descent
        with self._c.vanishing(way.extents):
            start, equal = self._beside(point, way)
            if start in (ABSENT, OPEN):
                return start
            if self._is_another(point, start):
                return OPEN
            gamma = np.zeros(len(way.zero), dtype=bool)
            gamma[way.either] = self._subsolves.sets(start.w, self._tolerances.biactive).gamma[way.either]
            sets = ActiveSets(self._subsolves.settled(start.w, way.zero), gamma)
            w = self._subsolves.at_limit(start.w, sets.zero, way.extents, point.w[way.extents].max())
            if w is None and inserts:
                return OPEN
            w = start.w if w is None else w
            step = self._subsolves.lpec(w, sets, self._tolerances.radius, equal, multipliers=-start.lam_g, enough=enough)
        if not step.solved:
            return OPEN
        return SETTLED if step.descent <= enough else self._grown(point, w, step.d, step.zero)

    def _beside(self, point, way):
        """The incumbent in the branch of a way, its places without extent, and the decisions in force; or the outcome."""
        start, zero, most = way.start.copy(), way.zero, np.full(len(point.w), np.inf)
        start[way.extents] = most[way.extents] = 0.0
        more = {'box': (-most, most), 'max_iter': PATIENCE}
        more['box'][0][way.extents] = 0.0
        first = self._subsolves.attempt(start, zero, None, 1.0, **more)
        if first is None or first.status in INFEASIBLE:
            # without a place to spare the branch lacks another change of the incumbent, which shows nothing about the order
            return ABSENT if way.spares else OPEN, None
        if first.solved and self._c.evaluate(first.w).f > point.f + AS_GOOD * max(1.0, abs(point.f)):
            return OPEN, None
        apart = self._decides(point.w, way.extents)
        solved, equal = self._branches.solutions.decided(first, zero, apart=apart, **more) if first.solved else (None, None)
        if first.solved and (solved is None or not solved.solved):
            # without decisions there is more room: an order that does not descend then does not descend with them
            solved, equal = self._subsolves.attempt(first.w, zero, None, 0.0, **more), np.zeros_like(apart)
        return (solved, equal) if solved is not None and solved.solved else (OPEN, None)

    def _is_another(self, point, other):
        """Whether another solution does not meet the incumbent: its places are not the same."""
        return abs(self._c.evaluate(other.w).f - point.f) > AS_GOOD * max(1.0, abs(point.f))

    def _decides(self, w, variables):
        """The decisions that involve variables: beside a place of extent zero nothing is decided, as changes lie on both sides."""
        return (self._c.gradients(w)[-1][:, variables].toarray() != 0.0).any(axis=1)

    def _grown(self, point, w, d, zero):
        """A point in the branch that is better than the incumbent; or OPEN."""
        enough = point.f - PROGRESS * max(1.0, abs(point.f))
        for start in (w + d, w):
            found = self._branches.solutions.certified(start, zero, max_iter=SECOND)
            if found is not None and found.f <= enough:
                return found
        return OPEN


def _follow(possible):
    """Whether there may be an order that is not tried: with one more place than is inserted at a time.

    The changes that come apart in it stay together where fewer places are inserted, which may leave no direction at all.  At an end
    of a row two places come in at a time, else one.
    """
    at_ends = {place for place in possible if isinstance(place, _AtEnd)}
    inner = [place for place in possible if isinstance(place, _Inserted)]
    many = max(Counter(place.row for place in at_ends).values(), default=0) > AT_END
    return many or any(one.precedes(other) for one, other in permutations(inner, 2))


def _differs(change, sets):
    """Whether a change is there; a bi-active or open pair lies on both sides of it already."""
    undecided = sets.gamma | sets.open
    clear = ~undecided[change.pairs] & ~undecided[change.partners]
    happening = (sets.zero[change.happening] != G_ZERO) & ~undecided[change.happening]
    return bool(happening.any() or np.any((sets.zero[change.pairs] != sets.zero[change.partners]) & clear))


def _is_alike(change, sets):
    """Whether nothing changes for certain."""
    undecided = sets.gamma | sets.open
    return not (_differs(change, sets) or undecided[change.pairs].any() or undecided[change.partners].any())


def _subsets(changes, fixed):
    """The changes that come apart from the rest: each one alone, all but one, and all if the place itself matters."""
    single = [[change] for change in changes]
    if len(changes) > 2:
        single += [[change for change in changes if change is not left_out] for left_out in changes]
    if fixed:
        return single + ([changes] if len(changes) > 1 else [])
    return single if len(changes) > 1 else []


def _moved(zero, moves):
    """The zero sides after some changes have moved."""
    found = zero.copy()
    for move in moves:
        found[move.ended] = G_ZERO
        found[move.targets] = zero[move.sources]
    return found


def _way(w, variable, zero, by_values, beyond, sets):
    """The branch in which a place has no extent, or none where there is no such place."""
    if variable is None:
        return []
    # of the pairs that follow from values both sides are looked at where both are zero: a place that grows may have either
    clear = ~(sets.gamma | sets.open)[by_values.sources]
    zero[by_values.targets[clear]] = sets.zero[by_values.sources[clear]]
    return [Entered(np.array([variable]), zero, w, by_values.targets, spares=_is_alike(beyond, sets))]
