"""Read a time series: increasing times, one value each, converted, checked, and thinned out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from numbers import Real

import numpy as np
from pyomo.common.dependencies import pandas as pd
from pyomo.core import value
from pyomo.core.base.units_container import UnitsError
from pyomo.dae import ContinuousSet
from pyomo.environ import units as pyomo_units

from pyomo_fesd.core import FesdError

#: Relative size of rounding errors.
ROUND_OFF = 1e-12


@dataclass(frozen=True)
class TimeSeries:
    """Values at increasing times (arrays of equal length)."""

    times: np.ndarray
    values: np.ndarray

    def at(self, t: float) -> float:
        """Return the value at ``t`` on the lines between the points."""
        return float(np.interp(t, self.times, self.values))

    def before(self, t: float) -> float:
        """Return the last value given before ``t``; at the first time its own."""
        return float(self.values[max(0, int(np.searchsorted(self.times, t)) - 1)])

    def inside(self, first: float, last: float) -> Iterator[float]:
        """Yield the times between two others."""
        return (t for t in self.times.tolist() if first < t < last)

    def slopes(self) -> TimeSeries:
        """Return the slopes of the lines, each from its first time on."""
        return TimeSeries(self.times[:-1], np.diff(self.values) / np.diff(self.times))

    def at_points(self, points: list[float], distance: float) -> TimeSeries:
        """Return the series with times as they are among ``points`` where these are closer than ``distance``."""
        points = np.array(points, dtype=float)
        nearest = points[np.abs(self.times[:, None] - points).argmin(axis=1)]
        return TimeSeries(np.where(np.abs(nearest - self.times) <= distance, nearest, self.times), self.values)


def read_time_series(wrt: ContinuousSet, times, values, stepped: bool, tolerance: float, units) -> tuple:
    """Return the ``TimeSeries`` over the horizon, and the unit of its values; arguments as of ``signal``.

    Raises
    ------
    FesdError
        for arguments that are no such series
    """
    if not isinstance(tolerance, Real) or not 0 <= tolerance < inf:
        raise FesdError(wrt, f"signal: tolerance={tolerance!r}", "give a number that is not negative")
    if units is not None and not hasattr(units, 'is_expression_type'):
        raise FesdError(wrt, f"signal: units={units!r} is not a unit", "give one of pyomo.environ.units, e.g. units.kg")
    times, values = _both(wrt, times, values)
    values, units = _in_units(wrt, values, units)
    series = TimeSeries(_numbers(wrt, times, 'times'), _numbers(wrt, values, 'values'))
    _check(wrt, series, stepped)
    kept = (_steps if stepped else _corners)(series, max(tolerance, ROUND_OFF * np.abs(series.values).max()))
    return TimeSeries(series.times[kept], series.values[kept]), units


def _both(wrt, times, values):
    """Times and values from a pandas.Series, a dictionary, or two sequences."""
    if values is not None:
        return times, values
    if isinstance(times, Mapping):
        times = pd.Series(times, dtype=object)
    if isinstance(times, pd.Series):
        return times.index, times.to_numpy()
    raise FesdError(
        wrt, "signal: there are no values", "give signal(m.t, times, values), or a pandas.Series with times as its index"
    )


def _in_units(wrt, values, units):
    """Values without units, and their unit: that of the first one, or the one asked for."""
    if hasattr(values, 'magnitude'):
        values = [v * getattr(pyomo_units, str(values.units)) for v in np.ravel(values.magnitude).tolist()]
    if isinstance(values, str) or not np.iterable(values):
        raise FesdError(wrt, f"signal: the values are {values!r}", "give a sequence of numbers")
    values = list(values)
    own = [pyomo_units.get_units(v) if hasattr(v, 'is_expression_type') else None for v in values]
    units = next((u for u in own if u is not None), None) if units is None else units
    try:
        return [v if u is None else value(pyomo_units.convert(v, units)) for v, u in zip(values, own)], units
    except UnitsError as error:
        raise FesdError(wrt, f"signal: the values have other units than {units}: {error}", "convert them") from None


def _numbers(wrt, given, what):
    if isinstance(given, (pd.DatetimeIndex, pd.TimedeltaIndex)):
        raise FesdError(
            wrt,
            f"signal: the {what} are dates",
            "give numbers in the unit of time of the model, e.g. (index - index[0]).total_seconds()",
        )
    try:
        found = np.array(list(given), dtype=float)
    except (TypeError, ValueError) as error:
        raise FesdError(wrt, f"signal: the {what} are no numbers ({error})", "give a sequence of numbers") from None
    if not np.isfinite(found).all():
        raise FesdError(wrt, f"signal: {what} number {int(np.argmin(np.isfinite(found)))} is not finite", "leave the point out")
    return found


def _check(wrt, series, stepped):
    times, values, least = series.times, series.values, 1 if stepped else 2
    if times.shape != values.shape or times.ndim != 1:
        raise FesdError(wrt, f"signal: {times.size} times, but {values.size} values", "give one value for each time")
    if times.size < least:
        raise FesdError(wrt, f"signal: it has {times.size} points", f"give {least} at least")
    falling = np.flatnonzero(np.diff(times) <= 0)
    if falling.size:
        k = falling[0]
        raise FesdError(
            wrt,
            f"signal: time {times[k + 1]:g} follows {times[k]:g}",
            "sort the times and give each once; for a jump between lines add a stepped signal to a linear one",
        )
    if times[0] > wrt.first() or (times[-1] < wrt.last() and not stepped):
        raise FesdError(
            wrt,
            f"signal: the times from {times[0]:g} to {times[-1]:g} do not cover the horizon from {wrt.first():g} to {wrt.last():g}",
            "give values at its first and last time",
        )


def _steps(series, tolerance):
    """Positions of the values that differ from the last one that counts."""
    kept = [0]
    for k, number in enumerate(series.values.tolist()):
        if abs(number - series.values[kept[-1]]) > tolerance:
            kept.append(k)
    return kept


def _corners(series, tolerance):
    """Positions of the points between which lines come closer to all others than ``tolerance`` (Ramer, Douglas, Peucker)."""
    kept, parts = {0, series.times.size - 1}, [(0, series.times.size - 1)]
    while parts:
        a, b = parts.pop()
        ends = [a, b]
        distance = np.abs(np.interp(series.times[a : b + 1], series.times[ends], series.values[ends]) - series.values[a : b + 1])
        k = int(distance.argmax())
        if distance[k] > tolerance:
            kept.add(a + k)
            parts += [(a, a + k), (a + k, b)]
    return sorted(kept)
