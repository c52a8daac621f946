"""Sources of expressions: active Constraints, Objectives and Complementarities, and the named Expressions that they use.

A source is the data of one of these components; its expressions can be read and set.
"""

from pyomo.core import Block, Constraint, Expression, Objective
from pyomo.core.expr import EqualityExpression, InequalityExpression, RangedExpression
from pyomo.gdp import Disjunct
from pyomo.mpec import Complementarity

from pyomo_fesd.core import FesdError, ancestry, own_data

ACTIVE = (Constraint, Objective, Complementarity)
TYPES = (*ACTIVE, Expression)
RELATIONS = (EqualityExpression, InequalityExpression, RangedExpression)


def sources(instance, targets):
    """Yield the active data of the targets (None: of ``instance``), and ExpressionData that are targets themselves.

    Raises
    ------
    FesdError
        for a target of another model or of another type
    """
    for target in targets or [instance]:
        if target.model() is not instance.model():
            raise FesdError(target, "this target belongs to another model", "give a component of the model itself")
        if target.ctype is Block:
            for block in _datas(target):
                yield from (d for d in own_data(block, ACTIVE, (Block, Disjunct), active=True) if d.active)
        elif target.ctype in TYPES:
            yield from (d for d in _datas(target) if target.ctype is Expression or d.active)
        else:
            raise FesdError(
                target,
                f"a target must be a Block, Constraint, Objective, Complementarity or Expression, not a {target.ctype.__name__}",
                "give the block or the constraint that holds the absolute value",
            )


def _datas(component):
    return component.values() if component.parent_component() is component else [component]


def expressions(source) -> list:
    """Return the expressions of a source: the sides of its relations, or its one expression."""
    return [side for whole in wholes(source) for side in _relation_sides(whole)]


def set_expressions(source, new) -> None:
    """Set the expressions of a source, in the order of ``expressions``."""
    new = iter(new)
    stated = []
    for whole in wholes(source):
        sides = [next(new) for _ in _relation_sides(whole)]
        stated.append(whole.create_node_with_local_data(sides) if isinstance(whole, RELATIONS) else sides[0])
    source.set_value(tuple(stated) if source.ctype is Complementarity else stated[0])


def wholes(source):
    """Return the two arguments of a condition, the one expression of other sources."""
    return getattr(source, '_args', None) or () if source.ctype is Complementarity else (source.expr,)


def _relation_sides(whole):
    return whole.args if isinstance(whole, RELATIONS) else (whole,)


def plain_name(data) -> str:
    """Return the name without any index: ``unit.state.flow`` for ``unit[a].state[0.5].flow[k]``."""
    return '.'.join(reversed([one.parent_component().local_name for one in ancestry(data)]))
