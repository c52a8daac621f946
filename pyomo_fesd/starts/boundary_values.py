"""Variables at element boundaries: whether states jump there, and the parts of conditions with hysteresis.

Takes: a moving grid whose states and weights have their values.
Leaves: values of ``e`` of the state jumps, and of ``n`` and ``m`` of the modes with hysteresis.
Does not apply: to impulses of contacts (``impulses``).
"""

import numpy as np

from pyomo_fesd.core import MovingGrid, TimeIndex, strip_time, value_or_nan
from pyomo_fesd.starts.consistent_values import solve_pair
from pyomo_fesd.starts.time_table import TimeTable

#: A jump of the table belongs to a boundary that is nearer than this part of the horizon.
NEAR = 1e-6


def set_jumps(moving: MovingGrid, times: TimeIndex, table: TimeTable) -> None:
    """Let a law act at a boundary where the table jumps, if the values after it are nearer to those of the table."""
    jumps, physical = moving.state_jumps, moving.physical_time()
    if jumps is None:
        return
    for element in moving.grid.elements[:-1]:
        here = jump_near(moving, table, physical[element.right])
        for law in jumps.laws:
            e = jumps.e[law.name, element.n]
            if not e.fixed:
                resets = law.resets.get(element.right, ())
                e.set_value(float(here is not None and _explains(resets, here, times, table)))


def jump_near(moving: MovingGrid, table: TimeTable, time: float) -> float | None:
    """Return the time at which the table jumps near a boundary; None if it does not."""
    at, physical = table.jump_times(), moving.physical_time()
    here = at[np.abs(at - time) <= NEAR * (max(physical.values()) - min(physical.values()))]
    return float(here[0]) if here.size else None


def _explains(resets, time, times, table):
    """Whether the values after a jump are nearer to the right limits of the table than those before."""
    stays = goes = 0.0
    for x, after in resets:
        series = table.series(strip_time(times.split(x)[1]))
        if series is not None:
            right = series.right_of(time)
            stays, goes = stays + abs(right - value_or_nan(x)), goes + abs(right - value_or_nan(after))
    return goes < stays


def set_hysteresis(moving: MovingGrid) -> None:
    """Set the parts of the conditions with hysteresis, each from its pair."""
    if moving.hysteresis is not None:
        for variables, pairs in ((moving.hysteresis.n, moving.hysteresis.parts), (moving.hysteresis.m, moving.hysteresis.least)):
            for index, v in variables.items():
                solve_pair(v, pairs[index])
