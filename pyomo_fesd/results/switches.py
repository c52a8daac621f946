"""Switches on physical time: changes of the active set, and state jumps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from pyomo.common.dependencies import pandas as pd
from pyomo.core import Block, value
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import Element, FesdError, TimeIndex, find_continuous_set, strip_time
from pyomo_fesd.results.complementarity_modes import complementarity_modes, positive_modes, relatively_positive_modes
from pyomo_fesd.results.disjunction_modes import disjunction_modes, surface_sides
from pyomo_fesd.results.physical_time import elements, physical_time
from pyomo_fesd.results.trajectory import jumps_that_happen

#: Where a trajectory of ``simulate`` has its switches, among its ``attrs``.
SWITCHES = 'switches'


class Switch(NamedTuple):
    """One change of mode at physical ``time`` (units of the ContinuousSet); a sliding mode reads ``sliding a | b``."""

    time: float
    disjunction: str
    before: str
    after: str

    def __str__(self):
        return f"time {self.time:.10g}: {self.disjunction}  {self.before} -> {self.after}"


class Switches(list):
    """The switches in order of time; prints one a line, and ``pandas.DataFrame(switches)`` has the fields as columns."""

    def __repr__(self):
        return '\n'.join(map(str, self)) or 'no switch'

    __str__ = __repr__


def switches(model: Block | pd.DataFrame, wrt: ContinuousSet | None = None) -> Switches:
    """Return the times at which a Disjunction, a surface of a piecewise function, or a hand-written Complementarity switches.

    An element of a moving grid has one active set (eq. 11), so switches lie on element boundaries.

    Parameters
    ----------
    model : Block, or DataFrame that ``simulate`` has returned
    wrt : ContinuousSet, optional

    Returns
    -------
    Switches
        list of ``Switch(time, disjunction, before, after)``

    Raises
    ------
    FesdError
        for a table without switches, as of ``trajectory``
    """
    if isinstance(model, pd.DataFrame):
        return _of_table(model)
    wrt = find_continuous_set(model, wrt, 'switches')
    return Switches(switch for _, switch in labelled_switches(model, wrt))


def _of_table(table):
    if SWITCHES not in table.attrs:
        raise FesdError('switches', "this table has none with it", "pass the one that simulate has returned, or the model")
    return Switches(Switch(*switch) for switch in table.attrs[SWITCHES])


def labelled_switches(model: Block, wrt: ContinuousSet) -> list[tuple[float, Switch]]:
    """Return ``(label, Switch)`` in order of time; the label is that of the element boundary at which it happens."""
    found, index = elements(wrt), TimeIndex(wrt)
    times = physical_time(model, wrt)
    systems = (_systems(model, index) | complementarity_modes(model, wrt, index)).items()
    changes = []
    for name, modes in systems:
        active = ((element.left, _active_mode(modes, element)) for element in found)
        changes += [(label, Switch(times[label], name, *both)) for label, *both in _changes(active)]
    for _, label, name, after in jumps_that_happen(model, wrt):
        before = [(x, value(x)) for x, _ in after]
        changes.append((label, Switch(times[label], name, _state_values(before, index), _state_values(after, index))))
    return sorted(changes, key=lambda change: change[1].time)


class ElementSwitches:
    """The switches so far, element by element, while the values on the elements change.

    Parameters
    ----------
    model : Block
    index : TimeIndex
    """

    def __init__(self, model: Block, index: TimeIndex):
        self._model, self._index, self._active = model, index, {}
        self._systems = _systems(model, index)
        self._has_own = bool(complementarity_modes(model, index.wrt, index))

    def add(self, solved: list[tuple[Element, float, float]]) -> None:
        """Add ``solved`` elements, each with the time of its left boundary and its length."""
        # some of their expressions are numbers
        own = complementarity_modes(self._model, self._index.wrt, self._index) if self._has_own else {}
        for name, modes in (self._systems | own).items():
            self._active.setdefault(name, []).extend((left, _active_mode(modes, element)) for element, left, _ in solved)

    @property
    def found(self) -> Switches:
        """The switches, at the times of left boundaries."""
        changes = (Switch(time, name, *both) for name, active in self._active.items() for time, *both in _changes(active))
        return Switches(sorted(changes, key=lambda switch: switch.time))


def _systems(model, index):
    """What switches besides hand-written complementarities: ``{name: {mode: {label: expression that is positive there}}}``."""
    return disjunction_modes(model, index) | surface_sides(model, index)


def _changes(active: Iterable[tuple]) -> Iterator[tuple]:
    """``(place, mode before, mode after)`` of one system, from the place where each element begins and its active mode."""
    before = None
    for place, mode in active:
        if mode is not None:
            if before is not None and mode != before:
                yield place, before, mode
            before = mode


def _active_mode(modes, element):
    """The mode with a positive multiplier inside an element; several slide; None where no multiplier is clear."""
    on = positive_modes(modes, element.points) or positive_modes(modes, (element.left,))
    on = on or relatively_positive_modes(modes, element.points)
    if not on:
        return None
    return on[0] if len(on) == 1 else 'sliding ' + ' | '.join(on)


def _state_values(values, index):
    return ', '.join(f'{strip_time(index.split(x)[1])} = {number:.6g}' for x, number in values)
