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
        self._model, self._times, self._grid = model, times, moving_grids(model)[times.wrt].grid
        self._columns = list(columns_over_time(model, times.wrt))
        # these alone are numbers already
        self._positions = {c.title for c in self._positions_in(())}
        self._rows, self._number, self._expressions = [], 0, {}

    def _positions_in(self, elements):
        found = complementarity_positions(self._model, self._times.wrt, self._times, elements)
        return [Column(name, mode, shares) for name, modes in found.items() for mode, shares in modes.items()]

    def begin(self, label: float) -> None:
        """Write the row of the first time."""
        self._write((label,), (float(label),), 1)

    def add(self, element: Element, left: float, length: float) -> None:
        """Write the rows of an ``element`` that begins at the time ``left``, with its present values."""
        self._number += 1
        labels = element.own_labels
        times = [left + c * length for c in self._grid.tau]
        self._write(labels, (*times, left + length)[: len(labels)], self._number, (element,))

    def _write(self, labels, times, number, elements=()):
        positions = {c.title: c.values for c in self._positions_in(elements)} if self._positions else {}
        for label, time in zip(labels, times):
            found = [value_or_nan(expr) for expr in self._at(label)]
            for k, title in enumerate(c.title for c in self._columns if self._positions):
                found[k] = positions[title].get(label, found[k]) if title in positions else found[k]
            self._rows.append((time, time, number, *found))

    def _at(self, label):
        """What the columns contain at a label."""
        if label not in self._expressions:
            self._expressions[label] = [None if c.title in self._positions else c.values.get(label) for c in self._columns]
        return self._expressions[label]

    def frame(self) -> pd.DataFrame:
        """Return the trajectory, index ``time``."""
        names = ['time', 'label', 'element', *(c.title for c in self._columns)]
        return pd.DataFrame(self._rows, columns=names).set_index('time')
