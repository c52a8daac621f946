"""March with a few elements: the first takes over the values of the last, and the others are solved again.

An element depends on what lies before it by the values at its left boundary only.  So a few places are enough for any number of
elements with the same equations.  Of the grid, the first E elements have the length h = (T - t_0)/nfe, and the last one, which is
never solved, fills the rest of the horizon:

    solve 1..E,   take down,   values of E -> 1,   solve 2..E,   take down,   values of E -> 1, ...            until T

An element ends early at a switch; the rest of the horizon is then shared by elements of at most the length h.

Takes: a model on such a grid, with one control stage.
Leaves: trajectory and switches; values of all variables at the first and the last time.
Does not apply: where the equations of the elements differ (``ElementsDiffer``), as with time labels in them.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import ceil

from pyomo.common.dependencies import pandas as pd
from pyomo.core import Block, Expression, Var
from pyomo.gdp import Disjunct

from pyomo_fesd.core import FesdError, TimeIndex, moving_grids, own_data, phase
from pyomo_fesd.diagnostics import MarchReview
from pyomo_fesd.finite_elements import differ
from pyomo_fesd.results import SWITCHES, ElementSwitches, ElementTable
from pyomo_fesd.simulation.element_solver import CUT, NO_STEP, ElementSolver
from pyomo_fesd.simulation.inputs import hold_first_values
from pyomo_fesd.simulation.progress import Progress, accumulation

#: E, the number of places.
PLACES = 4
#: Switches accumulate if the intervals between them shrink and are shorter than this part of an element.
SHORT = 1e-3
#: A rest of the horizon that is by less than this part of an element too long for a number of them needs no other.
ROUND_OFF = 1e-9


class ElementsDiffer(Exception):
    """The elements have different equations, so each needs a place of its own."""


class MarchingElements:
    """Simulates with all elements of a grid but the last; parameters as of ``simulate``, with a TimeIndex and a Deadline."""

    def __init__(self, model, times: TimeIndex, inputs, nfe: int, options, timer, deadline):
        self._timer, self._moving = timer, moving_grids(model)[times.wrt]
        self._places, self._first, self._last = self._moving.grid.elements[:-1], times.wrt.first(), times.wrt.last()
        self._h = (self._last - self._first) / nfe
        self._progress = Progress(times.wrt, self._moving.grid.stages, deadline)
        self._solver = ElementSolver(model, times, inputs, options, timer, self._progress)
        if not self._solver.are_alike(self._places[1:]) or _expressions_differ(model, times, self._places[1:]):
            raise ElementsDiffer
        self._over_time = list(times.families(own_data(model.model(), Var, (Block, Disjunct))).values())
        self._moves = self._pairs(self._places[0], self._places[-1])
        self._table, self._switches = ElementTable(model, times), ElementSwitches(model, times)
        self._review = MarchReview(model, times.wrt)

    def _pairs(self, to, source):
        """The variables of one place, each with that of the same name in another place."""
        labels = [(to.left, source.left), *zip(to.own_labels, source.own_labels)]
        return [(some[a], some[b]) for some in self._over_time for a, b in labels if a in some and b in some]

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
        self._solver.begin_stage()
        begin = [(some[self._first], some[self._first].value) for some in self._over_time if self._first in some]
        self._table.begin(self._first)
        try:
            place = self._march()
        except FesdError as error:
            error.trajectory = self.trajectory
            raise
        for v, number in begin:
            v.set_value(number, skip_validation=True)
        self._set_last(place.right)

    def _set_last(self, label):
        """Give the variables at the last time the values at another label; those that are fixed there keep theirs."""
        for some in self._over_time:
            if label in some and self._last in some and not some[self._last].fixed:
                some[self._last].set_value(some[label].value, skip_validation=True)

    def _march(self):
        """Solve one element after the other; returns the place of the last one."""
        rest, warm, solved, waiting = self._last - self._first, False, [], list(self._places)
        while rest > NO_STEP * self._h:
            if not waiting:
                solved, waiting = self._next_round(solved)
            place, aim = waiting.pop(0), rest / ceil(rest / self._h - ROUND_OFF)
            found, left = self._solver.solve(place, aim, warm), self._last - rest
            solved.append((place, left, found.length))
            rest -= found.length
            self._progress.time = self._last - rest
            warm = self._goes_on(found, aim)
        self._take_down(solved)
        return place

    def _goes_on(self, found, aim):
        """Whether the active set after an element is known; events are noted.

        Raises
        ------
        FesdError
            where switches accumulate
        """
        is_cut = found.length < aim - CUT * max(aim, self._h)
        if is_cut or found.events:
            events = self._progress.events[self._places[0].stage]
            events.append((self._progress.time, ', '.join(found.events) or 'switch'))
            if found.length < SHORT * self._h and accumulation(events) is not None:
                raise self._progress.error("too many switches", "end before")
        # after an event another active set holds
        return bool(found.events) or not is_cut

    def _next_round(self, solved):
        """Take down the solved elements and hand on the values of the last; returns what is solved then, and what is not."""
        self._take_down(solved)
        for to, source in self._moves:
            to.set_value(source.value, skip_validation=True)
        first, (last, left, length) = self._places[0], solved[-1]
        self._moving.r[first.n].set_value(self._moving.r[last.n].value, skip_validation=True)
        return [(first, left, length)], list(self._places[1:])

    def _take_down(self, solved):
        """Write the results of solved elements; the first of them is known if another round has solved it."""
        self._solver.end_pass()
        is_first = solved[0][1] == self._first
        new = solved if is_first else solved[1:]
        with phase(self._timer, 'trajectory'):
            self._table.add(new)
            self._switches.add(new)
        grid = self._moving.grid
        self._moving.grid = replace(grid, elements=tuple(place for place, *_ in solved))
        self._moving.begin = None if is_first else solved[0][1]
        with phase(self._timer, 'review'):
            self._review.look()
        self._moving.grid, self._moving.begin = grid, None

    @property
    def trajectory(self) -> pd.DataFrame:
        """The trajectory so far, with the switches in ``attrs``."""
        frame = self._table.frame()
        frame.attrs[SWITCHES] = self._switches.found
        return frame


def _expressions_differ(model, times, places):
    """Whether a named expression, which no equation need contain, has other numbers in other elements."""
    named = times.families(own_data(model, Expression, Block)).values()
    at_points = ([partial(some.__getitem__, place.points[0]) for place in places if place.points[0] in some] for some in named)
    return any(len(expressions) > 1 and differ(expressions) for expressions in at_points)
