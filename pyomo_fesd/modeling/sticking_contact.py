"""Contact of bodies that must not slip: forces along the two edges of the friction cone (theory, eq. 24).

With the gap g, the slip velocity w, and the forces a and b along the edges:

    normal = a + b,    friction = mu (a - b),    a, b >= 0
    g = d,    0 <= normal perp d >= 0;    w = p - n,    0 <= normal perp p + n >= 0,    p, n >= 0

All sides are sums of variables >= 0, which a branch fixes: the rest of its NLP keeps an interior.  Without a force p and n have a
common part that is free, so that the slip changes its sign in flight without a switch.

Takes: a block with its ``gap``.
Leaves: ``normal``, ``friction`` (Expressions) and ``touching`` on it, everything else on a generated block below.
"""

from pyomo.core import Block, Constraint, Expression, Var
from pyomo.core.base.block import BlockData
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import GENERATED, Contact, Dependents, FesdError, switched_systems, value_or_zero, without_unit


def add_sticking_contact(block: BlockData, slip, mu) -> Contact:
    """Add the forces and conditions of a contact that must not slip to ``block``, and return its record."""
    if isinstance(slip, (list, tuple)):
        raise FesdError(block, f"sticks=True with {len(slip)} slip velocities", "give one; in space leave out sticks")
    law = Block()
    block.add_component(GENERATED + 'sticking', law)
    law.forward, law.backward = Var(bounds=(0, None), initialize=0), Var(bounds=(0, None), initialize=0)
    block.normal = Expression(expr=law.forward + law.backward)
    block.friction = Expression(expr=mu * (law.forward - law.backward))
    _add_part(law, 'd', block.gap, 1)
    _add_part(law, 'p', slip, 1)
    _add_part(law, 'n', slip, -1)
    law.distance = Constraint(expr=without_unit(block.gap) == law.d)
    law.slips = Constraint(expr=without_unit(slip) == law.p - law.n)
    systems = switched_systems(law)
    systems.continuous[law.d] = law.distance
    systems.continuous[law.p] = systems.continuous[law.n] = law.slips
    block.touching = Complementarity(expr=complements(block.normal >= 0, law.d >= 0))
    law.sticking = Complementarity(expr=complements(block.normal >= 0, law.p + law.n >= 0))
    return Contact(block, block.gap, law.d, (law.forward, law.backward), block.touching, 0, law.sticking)


def _add_part(law, name, expr, sign):
    """A variable >= 0 that starts at the positive part of ``sign * expr``."""
    part = Var(bounds=(0, None), initialize=max(0.0, sign * float(value_or_zero(expr))))
    law.add_component(name, part)
    switched_systems(law).dependents.append(Dependents((part,), (expr,), _Part(sign)))


class _Part:
    """The positive part of ``sign`` times an argument; a class, as models are copied and pickled."""

    def __init__(self, sign):
        self._sign = sign

    def __call__(self, arguments):
        return [max(0.0, self._sign * arguments[0])]
