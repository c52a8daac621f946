"""Lengths of the elements from the times at which a table is not smooth, and the final time from its last.

Every smooth interval of a control stage gets elements of equal length, at least one, so that switches and jumps of the table are
element boundaries.

Takes: a moving grid and a ``TimeTable``.
Leaves: values of the length multipliers, and of lengths of time that are variables.
Does not apply: to control stages with more intervals than elements; their lengths stay as they are.
"""

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.core import value
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import FesdError, MovingGrid, numbers_of_elements
from pyomo_fesd.starts.time_table import TimeTable

#: A table may reach beyond the horizon by this part of it.
BEYOND = 1e-6


def set_within_bounds(v, number: float | None) -> None:
    """Set a value within the bounds, unless it is None or nan."""
    if number is not None and not np.isnan(number):
        v.set_value(float(np.clip(number, v.lb, v.ub)) if v.has_lb() or v.has_ub() else float(number), skip_validation=True)


def free_durations(moving: MovingGrid, table: TimeTable) -> ComponentMap:
    """Return the values of final time or lengths of control stages that the table implies: Var -> value.

    A free final time is the whole time of the table; lengths of control stages are those of a table with labels.
    """
    found, stages = ComponentMap(), ComponentMap()
    for elements in moving.grid.stages.values() if moving.sigma is not None else ():
        for v in identify_variables(moving.sigma[elements[0].n], include_fixed=False):
            stages.setdefault(v, []).extend(elements)
    for v, elements in stages.items():
        ends = [table.at_label(label) for label in (elements[0].left, elements[-1].right)]
        if None in ends and len(stages) == 1:
            ends = [table.times[0], table.times[-1]]
        if None not in ends and ends[1] > ends[0]:
            found[v] = ends[1] - ends[0]
    return found


def check_horizon(moving: MovingGrid, table: TimeTable) -> None:
    """Refuse times before the first or after the last time of the model.

    Raises
    ------
    FesdError
    """
    first = float(moving.wrt.first())
    last = first + sum(value(moving.duration(element)) for element in moving.grid.elements)
    slack = BEYOND * (last - first)
    outside = table.times[(table.times < first - slack) | (table.times > last + slack)]
    if outside.size:
        raise FesdError(
            moving.wrt,
            f"start_from: the table has time {outside[0]:g}, outside of the horizon from {first:g} to {last:g}",
            "cut the table, or shift its index",
        )


def place_elements(moving: MovingGrid, table: TimeTable) -> None:
    """Set the lengths of the elements of all control stages that have room for the intervals of the table."""
    time, boundaries = moving.physical_time(), table.boundaries()
    for elements in moving.grid.stages.values():
        begin, end = time[elements[0].left], time[elements[-1].right]
        close = BEYOND * (end - begin)
        inner = boundaries[(boundaries > begin + close) & (boundaries < end - close)]
        lengths = np.diff([begin, *inner, end])
        if inner.size and len(lengths) <= len(elements):
            numbers = numbers_of_elements(lengths, len(elements))
            for element, h in zip(elements, np.repeat(lengths / numbers, numbers)):
                _set_length(moving, element, h)


def _set_length(moving, element, h):
    multiplier = moving.r[element.n]
    if not multiplier.fixed:
        set_within_bounds(multiplier, multiplier.value * h / value(moving.duration(element)))
