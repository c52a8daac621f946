"""Controls that are held constant on each control stage of a moving grid."""

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core.moving_grid import MovingGrid
from pyomo_fesd.core.time_index import TimeIndex


def held_controls(moving: MovingGrid, times: TimeIndex) -> list[list]:
    """Return the variables of each held control on each control stage: lists in order of time that have one value each."""
    groups = ComponentMap()
    for row in () if moving.held is None else moving.held.values():
        *others, end = sorted(identify_variables(row.body, include_fixed=True), key=times.time)
        groups.setdefault(end, ComponentSet([end])).update(others)
    return [sorted(controls, key=times.time) for controls in groups.values()]
