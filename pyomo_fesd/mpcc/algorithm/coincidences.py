"""Coinciding changes: every order of them is tried before a point counts as certified.

In the incumbent the branches of all orders meet, but none of them is beside it for the LPEC: the place between two changes has no
extent there.  One is inserted (``insertions``), or several where they can follow one another.  Where one alone does not settle an
order, its branches may (``order_branches``).  A point with any other order is not certified.  Changes at an end of a row of places
coincide with the end (``arrivals``).
"""

from dataclasses import replace

import numpy as np

from pyomo_fesd.mpcc.algorithm.branch_solutions import one_of
from pyomo_fesd.mpcc.algorithm.order_branches import ABSENT, OPEN, SETTLED, OrderBranches
from pyomo_fesd.mpcc.algorithm.orders import NEAR_BOUND, Orders, has_more_at_end, rows
from pyomo_fesd.mpcc.algorithm.short_places import ShortPlaces
from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.mpcc.subproblems import Stationarity, Verdict

#: Times that a point may be replaced by one with fewer places of least extent: others lead back to the same ones.
REPLACED = 3
#: Verdicts that settle an order.
SETTLING = {Verdict.IMPOSSIBLE, Verdict.NO_DESCENT}


class Coincidences:
    """The coincidences of one run.

    Parameters
    ----------
    subsolves : Subsolves
    branches : Branches
    """

    def __init__(self, subsolves, branches):
        self._c, self._tolerances, self.run = subsolves.compiled, subsolves.tolerances, subsolves.run
        self._subsolves, self._branches = subsolves, branches
        self._orders, self._ways, self._short = Orders(subsolves), OrderBranches(subsolves, branches), ShortPlaces(branches)
        # all points whose orders are settled, and the last of them; those whose orders stayed open
        self._known, self._settled, self._open = [], None, set()
        # the point with places of least extent that was left last for a solution without them
        self._replacements, self._left = REPLACED, None

    def settle(self):
        """Try all orders of the incumbent, and of each better point found; mark it if one remains open."""
        while self.run.point is not None and self.run.point is not self._settled and self._c.has_objective:
            before = self.run.point
            if not before.certificate.certified:
                if not self._leads_on(before):
                    return
                continue
            if self._is_known(before) or self._takes_even(before):
                continue
            # until all orders are settled any certified point is better
            self.run.point = replace(before, certificate=replace(before.certificate, grade=Stationarity.OPEN))
            self._short.leave_out(before)
            found = self._outcome_once(before)
            if found is OPEN and (self._returns() or self._takes_fewer_short(before)):
                continue
            if found is SETTLED:
                self.run.point = self._settled = before
                self._known.append(before)
            elif found is not OPEN:
                self._left = None
                self._go_on(found)
            if found in (SETTLED, OPEN):
                return

    def _is_known(self, point):
        """Whether a more even point has led back to one whose orders were settled before, which is the incumbent then."""
        known = one_of(self._known, point, self._subsolves.parts.motion)
        if known is not None:
            self.run.point = self._settled = known
        return known is not None

    def _go_on(self, found):
        """Descend from a better point in another order."""
        self._branches.improve_from(found, True)
        if not self.run.point.certificate.certified:
            # it may have changes that leave at the other end, or beside a place at its lower bound
            self._branches.try_neighbours()

    def _leads_on(self, point):
        """Whether there is a point to go on from, as the incumbent is not certified.

        Where only places of least extent keep it from descending, these are to be passed by: the change beside such a place would
        happen earlier, or later.
        """
        sets = self._subsolves.sets(point.w, self._tolerances.biactive)
        for order in self._orders.at(point, sets) if point.certificate.grade is Stationarity.LIMITED else ():
            found = self._ways.grown(point, order.ways)
            if found is not None:
                self._go_on(found)
                return True
        return self._takes_fewer_short(point)

    def _takes_even(self, point):
        """Whether a solution without places of least extent, beside a point with some, is the incumbent now, whose orders are new.

        Beside such places orders are mostly not decided, and their branches end at these places again.
        """
        even = self._branches.without_short(point)
        if even is None or self._short.is_left_out(even.f):
            return False
        self.run.point, self._left = even, point
        return True

    def _returns(self):
        """Whether the point that was left for an even solution, of which orders stay open, is the incumbent again."""
        point, self._left = self._left, None
        if point is not None:
            self.run.point = point
        return point is not None

    def _takes_fewer_short(self, point):
        """Whether there is a point with fewer places of least extent, or a better one on the way, which is the incumbent now."""
        if not self._replacements:
            return False
        self._replacements -= 1
        before, other = self.run.point, self._short.fewer(point)
        if other is not None:
            self.run.point = other
        return self.run.point is not before

    def mark_untried(self):
        """Mark the incumbent as open if it is certified, and has orders that were not tried as a limit came before."""
        point = self.run.point
        if point is not None and point.certificate.certified and point is not self._settled and self._may_have_orders(point):
            self.run.point = replace(point, certificate=replace(point.certificate, grade=Stationarity.OPEN))

    def _may_have_orders(self, point):
        if not self._c.has_objective or self._is_flat(point):
            return False
        sets = self._subsolves.sets(point.w, self._tolerances.biactive)
        if self._holds_anything(point.w, sets) or self._short.are_at(point):
            return True
        return next(self._orders.at(point, sets), None) is not None

    def checked(self, w, certificate):
        """The certificate of a point that the LPEC has certified, after all orders were tried."""
        if not self._c.has_objective:
            return certificate
        nlp = NlpResult(w, self._c.evaluate(w).f, 'given', 0, np.zeros(0), np.zeros(0))
        found = self._outcome(Point(nlp, nlp.f, certificate), goes_on=False)
        if found is SETTLED:
            return certificate
        return replace(certificate, grade=Stationarity.OPEN if found is OPEN else Stationarity.DESCENT)

    def _outcome_once(self, point):
        """The outcome of a point; orders that stayed open are not tried again, as several branches have the same solution."""
        key = point.f, point.w.tobytes()
        found = OPEN if key in self._open else self._outcome(point)
        if found is OPEN:
            self._open.add(key)
        return found

    def _outcome(self, point, goes_on=True):
        """A better point; or whether all orders are settled.

        Where the run ``goes_on`` the point may also be one that no small step leads to.
        """
        outcome = SETTLED
        if self._is_flat(point):
            return SETTLED
        better = self._short.better(point)
        if better is not None:
            return better
        sets = self._subsolves.sets(point.w, self._tolerances.biactive)
        if self._holds_anything(point.w, sets):
            return OPEN
        possible = []
        for order in self._orders.at(point, sets):
            found = self._order(point, order, possible, goes_on)
            if found is OPEN:
                outcome = OPEN
            elif found is not SETTLED:
                return found
        return self._of_rows(point, sets, possible) if outcome is SETTLED else outcome

    def _of_rows(self, point, sets, possible):
        """Whether all orders with several places are settled, of which each one is ``possible`` alone."""
        if has_more_at_end(possible):
            return OPEN
        verdicts = (self._orders.judged(point, sets, row) for row in rows(possible))
        return SETTLED if all(verdict in SETTLING for verdict in verdicts) else OPEN

    def _order(self, point, order, possible, goes_on=True):
        """A better point in an order; or its outcome.  What it inserts is appended to ``possible`` if that is possible."""
        verdicts = set()
        for judge in order.judges:
            verdicts.add(judge())
            if verdicts & SETTLING:
                break
        if order.place is not None and Verdict.IMPOSSIBLE not in verdicts:
            possible.append(order.place)
        if verdicts & SETTLING:
            return SETTLED
        inserts = bool(verdicts - {Verdict.NONE})
        found = self._ways.search(point, order.ways, inserts, inserts and goes_on)
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
