"""What holds expressions: active Constraints, Objectives and Complementarities, and the named Expressions that they use."""

from pyomo.core import Block, Constraint, Expression, Objective
from pyomo.core.base.block import BlockData
from pyomo.core.expr import EqualityExpression, InequalityExpression, RangedExpression
from pyomo.gdp import Disjunct
from pyomo.mpec import Complementarity

from pyomo_fesd.errors import FesdError

ACTIVE = (Constraint, Objective, Complementarity)
TYPES = (*ACTIVE, Expression)
RELATIONS = (EqualityExpression, InequalityExpression, RangedExpression)


def sources(instance, targets):
    """The active data of the targets (None: of ``instance``), and ExpressionData that are targets themselves."""
    for target in targets or [instance]:
        if target.model() is not instance.model():
            raise FesdError(target, "this target belongs to another model", "give a component of the model itself")
        if target.ctype is Block:
            for block in [target] if isinstance(target, BlockData) else target.values():
                yield from block.component_data_objects(ACTIVE, active=True, descend_into=(Block, Disjunct))
        elif target.ctype in TYPES:
            datas = target.values() if target.parent_component() is target else [target]
            yield from (d for d in datas if target.ctype is Expression or d.active)
        else:
            raise FesdError(
                target,
                f"a target must be a Block, Constraint, Objective, Complementarity or Expression, not a {target.ctype.__name__}",
                "give the block or the constraint that holds the absolute value",
            )


def expressions(source):
    """The expressions of a source: the sides of its relations, or the one expression."""
    return [side for whole in _wholes(source) for side in _sides(whole)]


def put(source, new):
    """Set the expressions of a source, in the order of ``expressions``."""
    new = iter(new)
    wholes = []
    for whole in _wholes(source):
        sides = [next(new) for _ in _sides(whole)]
        wholes.append(whole.create_node_with_local_data(sides) if isinstance(whole, RELATIONS) else sides[0])
    source.set_value(tuple(wholes) if source.ctype is Complementarity else wholes[0])


def _wholes(source):
    """The two arguments of a condition, the one expression of anything else."""
    return getattr(source, '_args', None) or () if source.ctype is Complementarity else (source.expr,)


def _sides(whole):
    return whole.args if isinstance(whole, RELATIONS) else (whole,)


def plain_name(data):
    """The name without any index: ``unit.state.flow`` for ``unit[a].state[0.5].flow[k]``."""
    parts = []
    while data.parent_block() is not None:
        parts.append(data.parent_component().local_name)
        data = data.parent_block()
    return '.'.join(reversed(parts))
