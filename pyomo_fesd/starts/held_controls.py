"""Controls that are held on each control stage, from a table.

A held control gets the mean of the column over its control stage, where the value of a row holds since the row before, as
``trajectory`` writes controls.
"""

from collections.abc import Iterator

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import MovingGrid, TimeIndex


def held_intervals(moving: MovingGrid, times: TimeIndex) -> Iterator[tuple]:
    """Yield ``([VarData], begin, end)`` of every held control and control stage, in physical time."""
    if moving.held is None:
        return
    groups, owner, time = ComponentMap(), moving.grid.element_of(), moving.physical_time()
    for row in moving.held.values():
        *others, end = sorted(identify_variables(row.body, include_fixed=True), key=times.time)
        groups.setdefault(end, ComponentSet([end])).update(others)
    for end, controls in groups.items():
        first = min(map(times.time, controls))
        left = owner[first].left if first in owner else moving.wrt.first()
        yield list(controls), time[left], time[times.time(end)]
