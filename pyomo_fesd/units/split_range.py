"""Split range: one controller, two actuators, one closed while the other works (theory, eq. 14).

    (high - split) b - (split - low) a = u - split,     0 <= a  perp  b >= 0

a falls from 1 at u = low to 0 at u = split; b rises from 0 there to 1 at u = high.

Takes: the command u and the two openings a and b, variables.
Leaves: the equation ``sum`` and ``pair``; no variables.
Does not apply: to commands beyond low and high: let ``saturation`` come first.
"""

from pyomo.core import Block, Constraint
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import switched_systems
from pyomo_fesd.units.over_time import block_over, refuse_order, variable, with_unit


def split_range(*sets, command, first, second, split, low=0, high=1) -> Block:
    """Return a Block over ``sets`` that opens ``first`` below ``split`` and ``second`` above it.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    command : Var, Expression, expression or function (block, index, ...) -> expression
        the controller's output, between ``low`` and ``high``
    first, second : Var over ``sets``
        openings between 0 and 1, defined by nothing else; ``first`` is 1 at ``low``, ``second`` is 1 at ``high``
    split, low, high : number, Param, expression or function

    Raises
    ------
    FesdError
        for limits in the wrong order; when the Block is added, for openings that are not Vars
    """
    refuse_order('split_range', low=low, split=split)
    refuse_order('split_range', split=split, high=high)
    given = dict(command=command, first=first, second=second, split=split, low=low, high=high)
    return block_over(sets, _build_split_range, **given)


def _build_split_range(block, command, first, second, split, low, high):
    first, second = variable(first, block, 'first'), variable(second, block, 'second')
    low, split, high = (with_unit(limit, command) for limit in (low, split, high))
    block.sum = Constraint(expr=(high - split) * second - (split - low) * first == command - split)
    block.pair = Complementarity(expr=complements(first >= 0, second >= 0))
    switched_systems(block).continuous[second] = block.pair
