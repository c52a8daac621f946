"""March with a few elements: the first takes over the values of the last, and the others are solved again.

An element depends on what lies before it by the values at its left boundary only.  So a few places are enough for any number of
elements with the same equations.  Each interval between two boundaries that keep their time (of control stages, breakpoints of
signals, fixed points) has E places, and one element for the rest, which is never solved.  A single interval may have two places
and no rest, if these have the same equations:

    solve 1..E,   take down,   values of E -> 1,   solve 2..E,   take down,   values of E -> 1, ...            until its end

An element ends early at a switch; the rest of the interval is then shared by elements of at most the length h = (its length)/N.

Takes: a model on such a grid.
Leaves: trajectory and switches; values of all variables at the boundaries of the intervals.
Does not apply: where the equations of places differ (``ElementsDiffer``), as with time labels in them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil

from pyomo.common.dependencies import pandas as pd
from pyomo.core import Block, Expression, Var
from pyomo.gdp import Disjunct

from pyomo_fesd.core import Element, FesdError, TimeIndex, moving_grids, own_components, phase
from pyomo_fesd.diagnostics import MarchReview
from pyomo_fesd.finite_elements import differ
from pyomo_fesd.results import SWITCHES, ElementSwitches, ElementTable
from pyomo_fesd.simulation.element_solver import CUT, NO_STEP, ElementSolver
from pyomo_fesd.simulation.inputs import hold_first_values
from pyomo_fesd.simulation.progress import Progress, accumulation

#: Switches accumulate if the intervals between them shrink and are shorter than this part of an element.
SHORT = 1e-3
#: A rest that is by less than this part of an element too long for a number of them needs no other.
ROUND_OFF = 1e-9


class ElementsDiffer(Exception):
    """The elements have different equations, so each needs a place of its own."""


class TimeInElements(ElementsDiffer):
    """Their equations contain the time label, wherever the elements are."""


@dataclass(frozen=True)
class _Interval:
    """One interval between two boundaries that keep their time.

    Attributes
    ----------
    places : list of Element
    compared : list of Element
        places whose equations have to be alike; the first of an interval may have others, if several follow
    begin, end : float
    h : float
        length of its elements
    """

    places: list[Element]
    compared: list[Element]
    begin: float
    end: float
    h: float

    def aim(self, rest: float) -> float:
        """Return the length of the next element, with a ``rest`` of the interval."""
        return rest / ceil(rest / self.h - ROUND_OFF)


class MarchingElements:
    """Simulates with all elements of a grid but the last of each interval.

    Parameters as of ``simulate``, with a TimeIndex and a Deadline; ``numbers`` of elements, one for each interval.
    """

    def __init__(self, model, times: TimeIndex, inputs, numbers: Sequence[int], options, timer, deadline):
        self._timer, self._moving, self._first = timer, moving_grids(model)[times.wrt], times.wrt.first()
        self._intervals = list(_intervals(self._moving.grid, numbers))
        self._progress = Progress(times.wrt, self._moving.grid.stages, deadline)
        lengths = {place.n: interval.h for interval in self._intervals for place in interval.places}
        self._solver = ElementSolver(model, times, inputs, options, timer, self._progress, lengths)
        # what has the period of the places is equal in all of them
        if self._moving.explicit_time:
            raise TimeInElements
        for interval in self._intervals:
            if not self._solver.are_alike(interval.compared) or _expressions_differ(model, times, interval.places):
                raise ElementsDiffer
        self._over_time = list(times.families_in(own_components(model.model(), Var, (Block, Disjunct))).values())
        self._table, self._switches = ElementTable(model, times), ElementSwitches(model, times)
        self._review = MarchReview(model, times.wrt)

    def run(self) -> None:
        """Simulate up to the last time.

        Raises
        ------
        FesdError
            as ``simulate``; its attribute ``trajectory`` is that up to there
        """
        with phase(self._timer, 'begin'):
            self._solver.find_initial_values()
        hold_first_values(self._over_time, self._first, self._solver.given)
        self._solver.begin_pass()
        self._table.begin(self._first)
        found = self._values_at(self._first)
        try:
            for interval in self._intervals:
                self._solver.begin_stage()
                self._hand_on(self._march(interval).right, interval.end)
                found += self._values_at(interval.end)
        except FesdError as error:
            error.trajectory = self.trajectory
            raise
        # first places have taken over other values at the boundary on their left
        for v, number in found:
            v.set_value(number, skip_validation=True)

    def _values_at(self, label):
        return [(some[label], some[label].value) for some in self._over_time if label in some]

    def _hand_on(self, label, boundary):
        """Give the variables at the end of an interval the values at another label; those that are fixed there keep theirs."""
        for some in self._over_time:
            if label in some and boundary in some and not some[boundary].fixed:
                some[boundary].set_value(some[label].value, skip_validation=True)

    def _march(self, interval):
        """Solve one element after the other; returns the place of the last one."""
        rest, warm, solved, known = interval.end - interval.begin, False, [], 0
        waiting, moves = list(interval.places), self._pairs(interval.places[0], interval.places[-1])
        try:
            while rest > NO_STEP * interval.h:
                if not waiting:
                    self._take_down(solved, known)
                    solved, waiting, known = [self._start_again(interval, moves, solved[-1])], interval.places[1:], 1
                place, aim, left = waiting.pop(0), interval.aim(rest), interval.end - rest
                found = self._solver.solve(place, aim, warm)
                solved.append((place, left, found.length))
                rest -= found.length
                self._progress.time = interval.end - rest
                warm = self._goes_on(found, aim, interval)
        except FesdError:
            if len(solved) > known:
                self._take_down(solved, known)
            raise
        self._take_down(solved, known)
        return place

    def _pairs(self, to, source):
        """The variables of one place, each with that of the same name in another place."""
        labels = [(to.left, source.left), *zip(to.own_labels, source.own_labels)]
        return [(some[a], some[b]) for some in self._over_time for a, b in labels if a in some and b in some]

    def _start_again(self, interval, moves, last):
        """Give the first place the values of the ``last`` element, which it returns at its new place."""
        for to, source in moves:
            # most indicators stay as they are, and take long to set
            if to.value != source.value:
                to.set_value(source.value, skip_validation=True)
        first, (_, left, length) = interval.places[0], last
        self._moving.r[first.n].set_value(length / first.length, skip_validation=True)
        return first, left, length

    def _goes_on(self, found, aim, interval):
        """Whether the active set after an element is known; events are noted.

        Raises
        ------
        FesdError
            where switches accumulate
        """
        is_cut = found.length < aim - CUT * max(aim, interval.h)
        if is_cut or found.events:
            events = self._progress.events[interval.places[0].stage]
            events.append((self._progress.time, ', '.join(found.events) or 'switch'))
            if found.length < SHORT * interval.h and accumulation(events) is not None:
                raise self._progress.error("too many switches", "end before")
        # after an event another active set holds
        return bool(found.events) or not is_cut

    def _take_down(self, solved, known):
        """Write the results of elements that are ``solved``, but for the first ones that are ``known`` from the round before."""
        self._solver.end_pass()
        with phase(self._timer, 'trajectory'):
            self._table.add(solved[known:])
            self._switches.add(solved[known:])
        moving, grid = self._moving, self._moving.grid
        moving.grid = replace(grid, elements=tuple(place for place, *_ in solved))
        moving.begin, moving.known = solved[0][1], known
        with phase(self._timer, 'review'):
            self._review.look()
        moving.grid, moving.begin, moving.known = grid, None, 0

    @property
    def trajectory(self) -> pd.DataFrame:
        """The trajectory so far, with the switches in ``attrs``."""
        frame = self._table.frame()
        frame.attrs[SWITCHES] = self._switches.found
        return frame


def _intervals(grid, numbers) -> Iterator[_Interval]:
    """The places of each interval are one stretch between boundaries that keep their time, and its last element the next one."""
    stretches = list(grid.stages.values())
    if len(stretches) == 1:
        (places,) = stretches
        stretches = [places, places[-1:]]
    for places, (rest,), number in zip(stretches[0::2], stretches[1::2], numbers, strict=True):
        begin, end = places[0].left, rest.right
        compared = places if rest in places else places[1:]
        yield _Interval(places, compared, float(begin), float(end), (end - begin) / number)


def _expressions_differ(model, times, places):
    """Whether a named expression, which no equation need contain, has other numbers in other elements."""
    named = times.families_in(own_components(model, Expression, Block)).values()
    at_points = ([(some[t],) for place in places for t in place.points if t in some] for some in named)
    return any(len(expressions) > 1 and differ(expressions) for expressions in at_points)
