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

from pyomo_fesd.core import GENERATED, Contact, FesdError, switched_systems, without_unit
from pyomo_fesd.modeling.distance import add_distance, add_part


def add_sticking_contact(block: BlockData, slip, mu) -> Contact:
    """Add the forces and conditions of a contact that must not slip to ``block``, and return its record."""
    if isinstance(slip, (list, tuple)):
        raise FesdError(block, f"sticks=True with {len(slip)} slip velocities", "give one; in space leave out sticks")
    law = Block()
    block.add_component(GENERATED + 'sticking', law)
    law.forward, law.backward = Var(bounds=(0, None), initialize=0), Var(bounds=(0, None), initialize=0)
    block.normal = Expression(expr=law.forward + law.backward)
    block.friction = Expression(expr=mu * (law.forward - law.backward))
    add_distance(law, block.gap)
    add_part(law, 'p', slip, 1)
    add_part(law, 'n', slip, -1)
    law.slips = Constraint(expr=without_unit(slip) == law.p - law.n)
    systems = switched_systems(law)
    systems.continuous[law.p] = systems.continuous[law.n] = law.slips
    block.touching = Complementarity(expr=complements(block.normal >= 0, law.d >= 0))
    law.sticking = Complementarity(expr=complements(block.normal >= 0, law.p + law.n >= 0))
    return Contact(block, block.gap, law.d, (law.forward, law.backward), block.touching, 0, law.sticking)
