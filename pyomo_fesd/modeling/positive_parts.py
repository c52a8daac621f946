"""Positive parts max(0, z) on a user's block, for the functions of ``nonsmooth_functions``."""

from pyomo.common.autoslots import AutoSlots
from pyomo.core import Block
from pyomo.core.base.block import BlockData
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import (
    GENERATED,
    FesdError,
    add_positive_part,
    continuous_sets,
    declare_positive_part,
    discretised,
    in_unit_of,
    refuse_foreign,
)


class _Count(AutoSlots.Mixin):
    """Private data of a user's block: the number of positive parts requested on it."""

    __slots__ = ('requested',)

    def __init__(self):
        self.requested = 0


Block.register_private_data_initializer(_Count, scope='pyomo_fesd.modeling')


def check_block(block, z) -> None:
    """Refuse a block on which max(0, z) could not be followed over time.

    Raises
    ------
    FesdError
        if ``block`` is not one block, belongs to another model than the variables of z, or is not over their ContinuousSets
    """
    if not isinstance(block, BlockData):
        raise FesdError(
            getattr(block, 'name', str(block)),
            f"the first argument must be one block, which is to hold the new components, not {type(block).__name__}",
            "give the block of the rule: def rule(b, t): ... pyomo_fesd.maximum(b, ...)",
        )
    variables = list(identify_variables(z, include_fixed=True))
    refuse_foreign(variables, block.model(), block)
    known = continuous_sets(block)
    for v in variables:
        own = continuous_sets(v)
        # beside the time of the block, one place of a space that has all its points
        missing = [s for s in own if s not in known and (own.isdisjoint(known) or not discretised(s))]
        for wrt in missing[:1]:
            raise FesdError(
                block,
                f"'{v.name}' is a function of '{wrt.name}' and this block is not, so max(0, z) could not be followed over "
                f"'{wrt.name}'",
                f"call it in the rule of a Block over '{wrt.name}', with the block of that rule as first argument; for one "
                "single time, give the value a Var of its own",
            )


def next_number(block: BlockData) -> int:
    """The number of the next positive part on a user's block.

    Positive parts that bounds decide are counted too, so that each has the same number at all times.
    """
    count = block.private_data('pyomo_fesd.modeling')
    count.requested += 1
    return count.requested


def add_to_block(block: BlockData, number: int, z):
    """Add s = max(0, z/[z]) to a user's block, in a generated block of its own, and return s [z], max(0, z) in its unit."""
    name = GENERATED + 'functions'
    if block.component(name) is None:
        block.add_component(name, Block())
    generated = Block()
    block.component(name).add_component(f'kink_{number}', generated)
    declare_positive_part(generated)
    return in_unit_of(add_positive_part(generated, (), z), z)
