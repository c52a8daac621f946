"""The positive part of an expression, from which all continuous piecewise functions are made (theory, eq. 8).

    s = max(0, z/[z]):    0 <= s  perp  s - z/[z] >= 0

One variable and one pair, no equation; [z] is the unit of z, 1 in most models.  max(a, b) = b + max(0, a - b),
|z| = 2 max(0, z) - z; a piecewise linear function has one s for each breakpoint.  Both sides are continuous in time where z is, so
a change of side falls on an element boundary.

Takes: a block of its own, and z as an expression.
Leaves: ``s`` and ``complementarity`` on that block.
Does not apply: to functions that jump; they need a multiplier (theory, eq. 5).
"""

from pyomo.core import Var
from pyomo.core.base.block import BlockData
from pyomo.core.base.var import VarData
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core.evaluation import value_or_zero
from pyomo_fesd.core.switched_systems import switched_systems
from pyomo_fesd.core.time_index import stored_index
from pyomo_fesd.core.units_of_measure import without_unit


def declare_positive_part(block: BlockData, *index) -> None:
    """Declare ``s`` and ``complementarity`` on ``block`` over the sets ``index`` (without sets: as scalars)."""
    sparse = {'dense': False} if index else {}
    block.s = Var(*index, **sparse, bounds=(0, None))
    block.complementarity = Complementarity(*index)
    switched_systems(block).continuous[block.s] = block.complementarity


def add_positive_part(block: BlockData, index: tuple, z) -> VarData:
    """Add max(0, z/[z]) at ``index`` (empty for a scalar) and return the variable s."""
    return add_part_of_number(block, index, without_unit(z))


def add_part_of_number(block: BlockData, index: tuple, z) -> VarData:
    """Add max(0, z), where z has no unit, at ``index`` and return the variable s."""
    s = block.s[stored_index(index)]
    s.set_value(max(0.0, value_or_zero(z)), skip_validation=True)
    block.complementarity.add(stored_index(index), complements(s >= 0, s - z >= 0))
    return s
