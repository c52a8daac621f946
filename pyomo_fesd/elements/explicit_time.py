"""Data that depend on time labels become wrong when elements move: find them and point to a clock state."""

import logging

from pyomo.core import Block, Constraint, value
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.timeindex import TimeIndex, strip_time

logger = logging.getLogger('pyomo_fesd')

#: pyomo.dae's own equations, which contain the labels rightly.
DISCRETISATION = ('_disc_eq', '_cont_eq')


def warn_explicit_time(block, wrt, grid):
    """Warn once for each family of constraints whose numbers change over time.

    With all variables at one value, all points of a family that has no explicit time give the same number.  Control stages
    may have data of their own, so points are compared within a stage.
    """
    stage = {t: e.stage for e in grid.elements for t in _spread([*e.points])}
    constraints = (
        c
        for component in block.component_objects(Constraint, active=True, descend_into=Block)
        if not component.local_name.endswith(DISCRETISATION)
        for c in component.values()
        if c.active
    )
    for name, family in TimeIndex(wrt).families(constraints).items():
        points = _spread([t for t in family if t in stage])
        if any(_differ([family[t] for t in points if stage[t] == s]) for s in {stage[t] for t in points}):
            logger.warning(
                "%s: its numbers depend on the time label (a Param over time, or t itself in a rule). Labels are not physical "
                "time once elements move. Use a clock state: a Var with derivative 1 that starts at the first time.",
                strip_time(name),
            )


def _spread(points, most=12):
    """At most about a dozen of many points, spread over all of them."""
    return points[:: max(1, len(points) // most)]


def _differ(constraints):
    """Whether the constraints give different numbers where all variables have the same value."""
    numbers = [n for n in map(_at_one_value, constraints) if n is not None]
    return bool(numbers) and max(numbers) - min(numbers) > 1e-9 * max(1.0, *map(abs, numbers))


def _at_one_value(constraint, number=0.7):
    bounds = [b for b in (constraint.lower, constraint.upper) if b is not None]
    body = constraint.body - (bounds[0] if bounds else 0)
    kept = [(v, v.value, v.stale) for v in identify_variables(body, include_fixed=True)]
    try:
        for v, _, _ in kept:
            v.set_value(number, skip_validation=True)
        return value(body, exception=False)
    finally:
        for v, old, stale in kept:
            v.set_value(old, skip_validation=True)
            v.stale = stale
