"""Objectives through pyomo.dae's discretisation, which declares each one again if the model has an Integral.

That is how an objective comes to contain the integral over all points; but what ``set_value`` has made of it since its declaration
would be lost without a message.

Takes: a block whose time is about to be discretised.
Leaves: its objectives as they were stated last.
"""

from contextlib import contextmanager

from pyomo.core import Block, Objective
from pyomo.core.expr.compare import compare_expressions
from pyomo.core.expr.visitor import replace_expressions
from pyomo.dae import Integral

from pyomo_fesd.core import own_components


@contextmanager
def objectives_as_stated(block: Block):
    """Context of a discretisation, after which changed objectives are as they were before it, with the new integrals."""
    # an indexed Integral gets new data
    integrals = [(data, all_, index) for all_ in own_components(block, Integral, Block) for index, data in all_.items()]
    changed = [
        (objective, index, data.expr, data.sense)
        for objective in (own_components(block, Objective, Block) if integrals else ())
        for index, data in objective.items()
        if _is_changed(objective, index, data)
    ]
    yield
    renewed = {id(old): all_[index] for old, all_, index in integrals}
    for objective, index, expr, sense in changed:
        objective[index].set_value(replace_expressions(expr, renewed, remove_named_expressions=False))
        objective[index].sense = sense


def _is_changed(objective, index, data):
    """Whether an objective is another one than its declaration states."""
    if objective.rule is None:
        return False
    declared = objective.rule(objective.parent_block(), index)
    is_other = data.sense != objective._init_sense(objective.parent_block(), index)
    return is_other or not compare_expressions(declared, data.expr)
