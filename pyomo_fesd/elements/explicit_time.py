"""Data that depend on time labels become wrong when elements move: find them and point to a clock state."""

import logging

from pyomo.core import Block, Constraint, value
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.marks import is_generated
from pyomo_fesd.timeindex import is_indexed_by, time_position

logger = logging.getLogger('pyomo_fesd')

#: pyomo.dae's own equations, which contain the labels rightly.
DISCRETISATION = ('_disc_eq', '_cont_eq')


def warn_explicit_time(block, wrt, grid):
    """Warn once for each Constraint whose numbers change from one stage point to the next inside an element.

    With all variables at one value, two points of a family that has no explicit time give the same number.
    """
    several = next((e for e in grid.elements if len(e.points) > 1), None)
    points = several.points[:2] if several else [e.points[0] for e in grid.elements[:2]]
    if len(points) < 2:
        return
    for component in block.component_objects(Constraint, active=True, descend_into=Block):
        if not is_indexed_by(component, wrt) or is_generated(component) or component.local_name.endswith(DISCRETISATION):
            continue
        if _depends_on_time(component, time_position(component, wrt), points):
            logger.warning(
                "%s: its numbers depend on the time label (a Param over time, or t itself in the rule). Labels are not physical "
                "time once elements move. Use a clock state: a Var with derivative 1 that starts at the first time.",
                component.name,
            )


def _depends_on_time(component, position, points):
    for index, data in component.items():
        here = index if isinstance(index, tuple) else (index,)
        if here[position] == points[0]:
            there = (*here[:position], points[1], *here[position + 1 :])
            there = there if isinstance(index, tuple) else there[0]
            if there in component and data.active and component[there].active:
                a, b = _at_one_value(data), _at_one_value(component[there])
                if a is not None and b is not None and abs(a - b) > 1e-9 * max(1.0, abs(a)):
                    return True
    return False


def _at_one_value(constraint, number=0.7):
    body = constraint.body - (constraint.upper if constraint.upper is not None else constraint.lower)
    kept = [(v, v.value, v.stale) for v in identify_variables(body, include_fixed=True)]
    try:
        for v, _, _ in kept:
            v.set_value(number, skip_validation=True)
        return value(body, exception=False)
    finally:
        for v, old, stale in kept:
            v.set_value(old, skip_validation=True)
            v.stale = stale
