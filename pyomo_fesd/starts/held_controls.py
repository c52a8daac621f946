"""Controls that are held on each control stage, from a table.

A held control gets the mean of the column over its control stage, where the value of a row holds since the row before, as
``trajectory`` writes controls.
"""

from collections.abc import Iterator

from pyomo_fesd.core import MovingGrid, TimeIndex, held_controls


def held_intervals(moving: MovingGrid, times: TimeIndex) -> Iterator[tuple]:
    """Yield ``([VarData], begin, end)`` of every held control and control stage, in physical time."""
    owner, time = moving.grid.element_of(), moving.physical_time()
    for controls in held_controls(moving, times):
        first, last = times.time(controls[0]), times.time(controls[-1])
        left = owner[first].left if first in owner else moving.wrt.first()
        yield controls, time[left], time[last]
