"""Simulate all elements of a moving grid in one or more passes.

In a pass every element is as long as its step-size plan says, or ends at the next switch, the end of a mode with hysteresis, or a
jump.  Where these need more elements than a control stage has, the next pass keeps one in reserve for each of them; it goes on from
the beginning of this stage, as those before stay as they are.
"""

import logging

from pyomo_fesd.core import FesdError, moving_grids, phase
from pyomo_fesd.finite_elements import refuse_first_mode
from pyomo_fesd.simulation.element_solver import CUT, ElementSolver
from pyomo_fesd.simulation.progress import Progress, TooFewElements, accumulation
from pyomo_fesd.simulation.step_sizes import EvenSteps, equal_steps, equilibration_is_active

logger = logging.getLogger('pyomo_fesd')

#: Lengths between two switches are equal if they differ by less than the first part, or the second after the largest number of
#: passes.
EQUAL, NEARLY, PASSES = 1e-10, 1e-7, 6
SHORT_INTERVAL = (
    "simulate: from time %.6g to %.6g there is less time between two switches than the least element length %.3g, so mpec_hybrid "
    "will not find this solution. Take more elements (nfe)."
)


class Simulation:
    """Element-by-element simulation on one moving grid; parameters as of ``simulate``, with a TimeIndex and a Deadline.

    ``quick`` as of ElementSolver.
    """

    def __init__(self, model, times, inputs, options, timer, deadline, quick=False):
        self._timer = timer
        self._moving = moving_grids(model)[times.wrt]
        _refuse_sticking(self._moving.state_jumps)
        self._grid = self._moving.grid
        self._progress = Progress(times.wrt, self._grid.stages, deadline)
        self._solver = ElementSolver(model, times, inputs, options, timer, self._progress, quick=quick)
        self._simulated, self._warm, self._at_begin = {}, False, None

    def run(self) -> None:
        """Simulate all elements, and again with equal lengths between the switches found."""
        with phase(self._timer, 'begin'):
            self._solver.find_initial_values()
        refuse_first_mode(self._moving)
        self._fit_elements()
        if equilibration_is_active(self._moving):
            # another pass with the same plan may find other switches: it begins from other values
            fitted, events = [(v, v.value, v.stale) for v in self._solver.written()], self._progress.events
            if not self._equalise():
                self._put_back(fitted, events)
        self._warn_of_short_intervals()

    def _put_back(self, fitted, events):
        for v, number, stale in fitted:
            v.set_value(number, skip_validation=True)
            v.stale = stale
        self._progress.events = events

    def _fit_elements(self):
        """Repeat the pass from each control stage that does not have an element for each of its switches."""
        expected, tried, stages = dict.fromkeys(self._grid.stages, 0), set(), list(self._grid.stages)
        self._begin_pass()
        while (stage := self._simulate_stages(stages, EvenSteps(dict(expected)))) is not None:
            expected[stage] = self._expected_switches(stage)
            if tuple(expected.values()) in tried:
                raise self._too_few_elements(stage)
            tried.add(tuple(expected.values()))
            self._return_to(stage)
            stages = stages[stages.index(stage) :]

    def _too_few_elements(self, stage):
        number = sum(map(len, self._progress.events.values()))
        return self._progress.error(
            f"the elements of control stage {stage} are used up at time {self._progress.time:.6g}, after {number} switches",
            "take more elements (nfe)",
            TooFewElements,
        )

    def _expected_switches(self, stage):
        """The number of switches in a control stage whose elements did not fit; all of its elements if these accumulate there."""
        elements, events = self._grid.stages[stage], self._progress.events[stage]
        limit = accumulation(events)
        accumulate = limit is not None and limit[1] <= elements[-1].right
        return len(elements) - 1 if accumulate else len(events)

    def _equalise(self):
        """Repeat the pass with equal lengths between switches until they fit; returns whether they do."""
        plan, difference = equal_steps(self._moving, self._simulated)
        for _ in range(PASSES):
            if difference <= EQUAL:
                return True
            try:
                if self._pass(plan) is not None:
                    return False
            except FesdError:
                return False
            before, (plan, difference) = plan, equal_steps(self._moving, self._simulated)
            if plan.last != before.last:
                return False
        return difference <= NEARLY

    def _pass(self, plan):
        """Simulate all elements once; returns the control stage whose elements do not fit, None if all do."""
        self._begin_pass()
        return self._simulate_stages(self._grid.stages, plan)

    def _begin_pass(self):
        self._progress.begin()
        self._solver.begin_pass()
        self._warm = False

    def _simulate_stages(self, stages, plan):
        """Simulate the last ``stages`` of a pass; returns the first one whose elements do not fit, None if all do."""
        for stage in stages:
            self._at_begin = self._solver.mark(), self._progress.time, self._warm
            if not self._simulate_stage(stage, plan):
                return stage
        self._solver.end_pass()
        return None

    def _return_to(self, stage):
        """Return to the beginning of the control stage that was simulated last."""
        mark, self._progress.time, self._warm = self._at_begin
        self._solver.return_to(mark)
        self._progress.events[stage].clear()

    def _simulate_stage(self, stage, plan):
        """Simulate the elements of a control stage; returns whether they fill it."""
        elements, events = self._grid.stages[stage], self._progress.events[stage]
        rest = sum(e.length for e in elements)
        self._solver.begin_stage()
        for number, element in zip(range(len(elements), 0, -1), elements):
            aim = plan.longest(element, rest, number, len(events))
            found = self._simulated[element.n] = self._solver.solve(element, aim, self._warm)
            tolerance = CUT * max(aim, element.length)
            cut = found.length < aim - tolerance
            # after an event another active set holds
            self._warm = bool(found.events) or not cut
            rest -= found.length
            self._progress.time += found.length
            if cut or found.events:
                events.append((self._progress.time, ', '.join(found.events) or 'switch'))
            if (rest <= tolerance) != (number == 1):
                return False
        return True

    def _warn_of_short_intervals(self):
        """Warn where two switches are closer than the least element length: the full problem has no such solution."""
        time = self._moving.physical_time()
        for stage, elements in self._grid.stages.items():
            begin = time[elements[0].left]
            end = begin + sum(e.length * self._moving.r[e.n].value for e in elements)
            times = [begin, *(time for time, _ in self._progress.events[stage]), end]
            least = min(e.length * (self._moving.r[e.n].lb or 0.0) for e in elements)
            for a, b in zip(times, times[1:]):
                if 0 < b - a < least * (1 - CUT):
                    logger.warning(SHORT_INTERVAL, a, b, least)


def _refuse_sticking(jumps):
    """Refuse contacts that must not slip: where friction cannot hold the bodies, no law says how they move."""
    sticking = [] if jumps is None or jumps.impacts is None else jumps.impacts.sticking
    if sticking:
        raise FesdError(
            sticking[0],
            "simulate: its bodies must not slip (sticks=True), which is a condition on the controls and no law of motion",
            "solve with mpec_hybrid, or simulate a model without sticks",
        )
