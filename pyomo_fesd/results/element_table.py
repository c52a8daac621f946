"""A trajectory that is written element by element, while the values on the elements change.

Takes: a model on a moving grid.
Leaves: the columns of ``trajectory``; a ``label`` is the physical time, and elements are numbered in the order in which they come.
Does not apply: to second rows where states jump.
"""

from __future__ import annotations

from pyomo.common.dependencies import pandas as pd
from pyomo.core import Block

from pyomo_fesd.core import Element, TimeIndex, moving_grids, value_or_nan
from pyomo_fesd.results.complementarity_modes import complementarity_positions
from pyomo_fesd.results.trajectory import Column, columns_over_time


class ElementTable:
    """The rows of a trajectory so far.

    Parameters
    ----------
    model : Block
    times : TimeIndex
    """

    def __init__(self, model: Block, times: TimeIndex):
        self._model, self._times, self._tau = model, times, moving_grids(model)[times.wrt].grid.tau
        self._columns = list(columns_over_time(model, times.wrt))
        self._has_positions = bool(self._positions(()))
        self._rows, self._times_of_rows, self._number, self._at = [], [], 0, {}

    def begin(self, label: float) -> None:
        """Write the row of the first time."""
        self._write((label,), (float(label),), 1, self._positions(()))

    def add(self, solved: list[tuple[Element, float, float]]) -> None:
        """Write the rows of ``solved`` elements, each with the time of its left boundary and its length."""
        positions = self._positions(tuple(element for element, *_ in solved)) if self._has_positions else {}
        for element, left, length in solved:
            self._number += 1
            times = [*(left + c * length for c in self._tau), left + length]
            self._write(element.own_labels, times[: len(element.own_labels)], self._number, positions)

    def _positions(self, elements):
        """The columns that are numbers already when they are read, by title."""
        found = complementarity_positions(self._model, self._times.wrt, self._times, elements)
        return {Column(name, mode, {}).title: shares for name, modes in found.items() for mode, shares in modes.items()}

    def _write(self, labels, times, number, positions):
        for label, time in zip(labels, times):
            found = [value_or_nan(expr) for expr in self._contents(label)]
            for k, column in enumerate(self._columns) if positions else ():
                if column.title in positions:
                    found[k] = value_or_nan(positions[column.title].get(label))
            self._times_of_rows.append(time)
            self._rows.append((time, number, *found))

    def _contents(self, label):
        """What the columns contain at a label."""
        if label not in self._at:
            self._at[label] = [column.values.get(label) for column in self._columns]
        return self._at[label]

    def frame(self) -> pd.DataFrame:
        """Return the trajectory, index ``time``."""
        names, index = ['label', 'element', *(column.title for column in self._columns)], pd.Index(self._times_of_rows, name='time')
        return pd.DataFrame(self._rows, index, names)
