"""Start from a simulation (option ``simulate_first``): first where nothing is free, else where the homotopy finds no point.

The room ``simulation`` lies above this one and uses its solvers; it registers what is called here.

Takes: a model, the options, and the deadline of the run.
Leaves: the simulated values in the model, or as an array; after a failure, on ``restore``, and where the run ends with a
FesdError, the values of before.
"""

import time
from collections.abc import Callable

import numpy as np
from pyomo.core import Block, Var
from pyomo.gdp import Disjunct

from pyomo_fesd.core import FesdError, moving_grids, own_data, withheld_messages
from pyomo_fesd.mpcc import Deadline
from pyomo_fesd.solvers.drawn_controls import draw_controls, refuse_without_controls

#: Part of the time limit that a simulation may take.
SHARE = 0.5
#: What ``register_simulation`` was given.
_registered = []


def register_simulation(simulation: Callable) -> None:
    """Let ``simulation`` look for starts.

    Parameters
    ----------
    simulation : callable (model, demanded, quick, timer, seconds) -> bool
        writes the values of a simulation into the model; False where it does not apply, a FesdError where it fails; ``demanded``
        also asks for one where something is free, and ``quick`` for one that fails rather than searches for long
    """
    _registered.append(simulation)


class SimulatedStart:
    """The start of one run.

    Attributes
    ----------
    found : bool
        whether the model has the values of a simulation
    note : str
        for the log and for the reason of a failure; empty where no simulation applies
    """

    def __init__(self, model: Block, options, deadline: Deadline):
        self.found, self.note, self._before = False, '', []
        self._model, self._options, self._deadline = model, options, deadline
        if options.simulate_first is False or options.warm_start or options.mode != 'hybrid' or model.model() is not model:
            self._further = False
            return
        self._remember()
        try:
            self.found = self._simulate("simulated first", options.simulate_first is True)
        finally:
            if not self.found:
                self.restore()
        grids = list(moving_grids(model).values())
        self._further = not self.note and len(grids) == 1 and not _sticks(grids[0])

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if kind is not None and issubclass(kind, FesdError):
            self.restore()

    def further(self, compiled) -> Callable | None:
        """Return a function that simulates once more, with all that is free at its present value; None where that is no help.

        It returns the values in the units of ``compiled`` (MpccFunctions), or None, and a note for the log; the model is left as it
        was.
        """
        return (lambda: self._values_of_simulation(compiled)) if self._further else None

    def completion(self, compiled) -> Callable | None:
        """Return a function that simulates with the controls of a point; None where no state jumps, or nothing can be simulated.

        It takes an array in the units of ``compiled`` (MpccFunctions) and the seconds that it may take.  It returns the simulated
        values, those of the array after the time at which the simulation fails; whether it is complete; and a note for the log.
        The model is left as it was.
        """
        grids = list(moving_grids(self._model).values())
        applies = self._options.simulate_first is not False and self._options.mode == 'hybrid'
        if not applies or len(grids) != 1 or grids[0].state_jumps is None or _sticks(grids[0]):
            return None
        return lambda w, seconds: self._completed(compiled, w, seconds)

    def draw(self, compiled) -> Callable | None:
        """Return a function that draws the controls of a start and simulates with them; None unless ``starts_vary`` asks for that.

        It takes the number of the start, and returns an array in the units of ``compiled`` (MpccFunctions): where the simulation
        fails, the values of the model after this time.  The model is left as it was.

        Raises
        ------
        FesdError
            for a model without one moving grid, or without controls
        """
        if self._options.starts == 1 or self._options.starts_vary != 'controls':
            return None
        grids = list(moving_grids(self._model).values())
        if len(grids) != 1:
            raise FesdError(
                self._model,
                f"starts_vary='controls': the model has {len(grids)} moving grids",
                "apply fesd.finite_elements to one ContinuousSet, or let starts_vary be 'variables'",
            )
        refuse_without_controls(grids[0])
        return lambda number: self._drawn(compiled, grids[0], number)

    def _drawn(self, compiled, moving, number):
        left, before = self._deadline.left(), self.note
        self._remember()
        try:
            draw_controls(moving, self._options.seed, number)
            self._simulate("drawn controls simulated", True, None if left is None else left / self._options.starts)
            return compiled.present_values()
        finally:
            self.note = before
            self.restore()

    def _completed(self, compiled, w, seconds):
        before = self.note
        self._remember()
        for v, number in zip(compiled.variables, compiled.values(w)):
            if not v.fixed:
                v.set_value(float(number), skip_validation=True)
        try:
            complete = self._simulate("its controls simulated", True, seconds, quick=True)
            note = "its controls simulated" + " in part" * (not complete)
            return compiled.present_values(), complete, note
        finally:
            self.note = before
            self.restore()

    def _values_of_simulation(self, compiled) -> tuple[np.ndarray | None, str]:
        self._remember()
        try:
            found = self._simulate("no feasible point, so simulated", True)
            return compiled.present_values() if found else None, self.note
        finally:
            self.restore()

    def _simulate(self, what, demanded, seconds=None, quick=False):
        """Write a simulation into the model, with a note; returns whether there is one."""
        began, left = time.perf_counter(), self._deadline.left()
        try:
            with withheld_messages('pyomo_fesd'):
                most = seconds if left is None else min(SHARE * left, seconds or left)
                found = any(one(self._model, demanded, quick, self._options.timer, most) for one in _registered)
            if found:
                self.note = f"{what} in {time.perf_counter() - began:.2f} s (simulate_first): the values are the start"
        except FesdError as error:
            found = False
            self.note = f"{what} (simulate_first), without success: {error.component}: {error.cause}"
        return found

    def _remember(self):
        self._before = [(v, v.value, v.stale) for v in own_data(self._model, Var, (Block, Disjunct))]

    def reason(self, refused: str) -> str:
        """Return what a run that failed saw of this start; ``refused`` says why it is no solution."""
        return self.note + f", and were not accepted: {refused}" * bool(self.found and refused)

    def restore(self) -> None:
        """Give the model the values of before."""
        for v, number, stale in self._before:
            if v.value != number:
                v.set_value(number, skip_validation=True)
            v.stale = stale


def _sticks(moving):
    """Whether there are contacts that must not slip, which cannot be simulated."""
    impacts = None if moving.state_jumps is None else moving.state_jumps.impacts
    return impacts is not None and bool(impacts.sticking)
