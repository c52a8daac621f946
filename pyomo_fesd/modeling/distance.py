"""Variables >= 0 that follow from an expression: the distance of two bodies, and the parts of a slip velocity.

The sides of a contact's conditions are sums of them.  A branch makes such a sum zero by bounds, and the rest of its NLP keeps an
interior; with the gap itself there were an equation gap = 0 beside gap >= 0.

Takes: a generated block, and an expression.
Leaves: the variable on the block, its value at the start, and how it follows its expression.
"""

from pyomo.core import Constraint, Var
from pyomo.core.base.block import BlockData

from pyomo_fesd.core import Dependents, switched_systems, value_or_zero, without_unit


def add_distance(law: BlockData, gap) -> None:
    """Add ``d`` >= 0 and the Constraint ``distance``, gap = d, to ``law``."""
    add_part(law, 'd', gap, 1)
    law.distance = Constraint(expr=without_unit(gap) == law.d)
    switched_systems(law).continuous[law.d] = law.distance


def add_part(law: BlockData, name: str, expr, sign: int) -> None:
    """Add a variable >= 0 that starts at the positive part of ``sign * expr``."""
    part = Var(bounds=(0, None), initialize=max(0.0, sign * float(value_or_zero(expr))))
    law.add_component(name, part)
    switched_systems(law).dependents.append(Dependents((part,), (expr,), _Part(sign)))


class _Part:
    """The positive part of ``sign`` times an argument; a class, as models are copied and pickled."""

    def __init__(self, sign):
        self._sign = sign

    def __call__(self, arguments):
        return [max(0.0, self._sign * arguments[0])]
