"""A table on physical time: its checks, and the values of its columns between the rows.

Takes: a DataFrame with physical time as its index; two rows of the same time are the values left and right of it.
Leaves: numbers; beyond its first and its last time a column keeps its first and its last value.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from pyomo.common.dependencies import pandas as pd

from pyomo_fesd.core import FesdError

#: Columns by which ``trajectory`` gives the origin of a row.
LABEL, ELEMENT = 'label', 'element'
#: Times that differ by less than this part of the whole are equal.
SAME_TIME = 1e-9


class Series:
    """One column: ``times`` in order, and its ``values``."""

    def __init__(self, times: np.ndarray, values: np.ndarray, close: float):
        self.times, self.values, self._close = times, values, close

    def at(self, time: float) -> float:
        """Return the value by linear interpolation; the left limit where the column jumps."""
        j = int(np.searchsorted(self.times, time - self._close))
        if j == 0 or j == len(self.times) or self.times[j] - time <= self._close:
            return float(self.values[min(j, len(self.times) - 1)])
        (a, b), (x, y) = self.times[j - 1 : j + 1], self.values[j - 1 : j + 1]
        return float(x + (time - a) / (b - a) * (y - x))

    def right_of(self, time: float) -> float:
        """Return the value in the last of the rows at ``time``: the right limit."""
        j = int(np.searchsorted(self.times, time + self._close)) - 1
        return float(self.values[max(j, 0)])

    def held(self, time: float) -> float:
        """Return the value of the first row at ``time`` or later: a row holds since the row before."""
        return float(self.values[min(int(np.searchsorted(self.times, time - self._close)), len(self.times) - 1)])

    def mean(self, begin: float, end: float) -> float:
        """Return the mean between two times, where each row holds since the row before."""
        if end - begin <= self._close:
            return self.held(end)
        edges = np.clip(np.concatenate([[begin], self.times[:-1], [end]]), begin, end)
        return float(np.diff(edges) @ self.values / (end - begin))


class TimeTable:
    """The checked table.

    Parameters
    ----------
    frame : pandas.DataFrame
    known : iterable of str
        the columns that may occur

    Raises
    ------
    FesdError
        for what is no table, unknown columns, times that are no numbers or not in order, and missing values
    """

    def __init__(self, frame: pd.DataFrame, known: Iterable[str]):
        _check_columns(frame, list(known))
        self.times = _numbers(frame.index, 'the index')
        _check_times(self.times)
        self._close = SAME_TIME * max(self.times[-1] - self.times[0], SAME_TIME * abs(self.times[-1]))
        self.titles = [title for title in frame.columns if title not in (LABEL, ELEMENT)]
        self._origin = {name: _numbers(frame[name], name) for name in (LABEL, ELEMENT) if name in frame.columns}
        self._series = {title: self._read(title, _numbers(frame[title], title)) for title in self.titles}

    def _read(self, title, values):
        """One column; rows without a value are left out where ``trajectory`` writes such."""
        missing = ~np.isfinite(values)
        wrong = np.flatnonzero(missing & ~self._repeated)
        if wrong.size and LABEL not in self._origin:
            raise FesdError(
                title,
                f"start_from: its value at time {self.times[wrong[0]]:g} is {values[wrong[0]]}",
                "give a number in every row, or leave out the column; only the second row of two with the same time may be without",
            )
        return None if missing.all() else Series(self.times[~missing], values[~missing], self._close)

    @property
    def _repeated(self):
        return np.append(False, np.diff(self.times) <= self._close)

    def series(self, title: str) -> Series | None:
        """Return a column by its title; None where it is missing or has no value."""
        return self._series.get(title)

    def at_label(self, label: float) -> float | None:
        """Return the time of the first row with a label; None where the table has no such row."""
        rows = np.flatnonzero(self._origin.get(LABEL, np.empty(0)) == label)
        return float(self.times[rows[0]]) if rows.size else None

    def jump_times(self) -> np.ndarray:
        """Return the times that have two rows or more."""
        return np.unique(self.times[self._repeated])

    def boundaries(self) -> np.ndarray:
        """Return the times between which the table is smooth: ends of its elements where it names them, else its jumps."""
        if ELEMENT not in self._origin:
            return self.jump_times()
        last = np.append(np.diff(self._origin[ELEMENT]) != 0, True)
        # the row after a jump has the number of the next element already
        ends = np.where(self._repeated & last, np.nan, self.times)[last]
        return np.unique(np.concatenate([ends[np.isfinite(ends)], self.jump_times()]))


def _check_columns(frame, known):
    if not isinstance(frame, pd.DataFrame):
        raise FesdError(
            'start_from',
            f"a {type(frame).__name__} is neither a table nor a model",
            "give a pandas.DataFrame with time as its index, or a model",
        )
    if not len(frame):
        raise FesdError('start_from', "the table has no rows", "give at least one time")
    if frame.columns.has_duplicates:
        raise FesdError(frame.columns[frame.columns.duplicated()][0], "start_from: two columns have this title", "leave one")
    for title in frame.columns:
        if title not in (*known, LABEL, ELEMENT):
            raise FesdError(title, "start_from: the model has no variable over time of this name", f"one of: {', '.join(known)}")


def _check_times(times):
    if not np.isfinite(times).all():
        raise FesdError('start_from', "the index has a time that is not a number", "give physical times as the index")
    back = np.flatnonzero(np.diff(times) < 0)
    if back.size:
        raise FesdError(
            'start_from',
            f"time {times[back[0] + 1]:g} comes after {times[back[0]]:g}",
            "sort the table by time: frame.sort_index(kind='stable')",
        )


def _numbers(column, title):
    try:
        return np.asarray(column, dtype=float)
    except (TypeError, ValueError):
        raise FesdError(title, "start_from: it has values that are not numbers", "give numbers only") from None
