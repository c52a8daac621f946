"""What holds expressions: active Constraints and Objectives, and the named Expressions that they use."""

from pyomo.core import Block, Constraint, Expression, Objective
from pyomo.core.base.block import BlockData
from pyomo.gdp import Disjunct

from pyomo_fesd.errors import FesdError

TYPES = (Constraint, Objective, Expression)


def sources(instance, targets):
    """The active ConstraintData and ObjectiveData of the targets (None: of ``instance``), and ExpressionData that are targets."""
    for target in targets or [instance]:
        if target.model() is not instance.model():
            raise FesdError(target, "this target belongs to another model", "give a component of the model itself")
        if target.ctype is Block:
            for block in [target] if isinstance(target, BlockData) else target.values():
                yield from block.component_data_objects((Constraint, Objective), active=True, descend_into=(Block, Disjunct))
        elif target.ctype in TYPES:
            datas = target.values() if target.parent_component() is target else [target]
            yield from (d for d in datas if target.ctype is Expression or d.active)
        else:
            raise FesdError(
                target,
                f"a target must be a Block, Constraint, Objective or Expression, not a {target.ctype.__name__}",
                "give the block or the constraint that holds the absolute value",
            )


def expressions(source):
    """The expressions of a source: both sides of a relation, or the one expression."""
    return source.expr.args if source.ctype is Constraint else (source.expr,)


def put(source, new):
    """Set the expressions of a source, in the order of ``expressions``."""
    source.set_value(source.expr.create_node_with_local_data(new) if source.ctype is Constraint else new[0])


def plain_name(data):
    """The name without any index: ``unit.state.flow`` for ``unit[a].state[0.5].flow[k]``."""
    parts = []
    while data.parent_block() is not None:
        parts.append(data.parent_component().local_name)
        data = data.parent_block()
    return '.'.join(reversed(parts))
