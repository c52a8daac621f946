"""Equations of the user without a time of their own: some are solved before a simulation, and others follow from it.

Takes: a model.
Leaves: nothing.
"""

from pyomo.core import Block, Constraint
from pyomo.core.base.constraint import ConstraintData

from pyomo_fesd.core import TimeIndex, is_generated


def timeless_equations(model: Block, times: TimeIndex) -> list[ConstraintData]:
    """Return the active equations that have no time."""
    rows = model.component_data_objects(Constraint, active=True, descend_into=Block)
    # most equations are over time, and this is the cheapest question
    return [c for c in rows if times.time(c) is None and c.equality and not is_generated(c)]
