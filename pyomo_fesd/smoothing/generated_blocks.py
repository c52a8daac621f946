"""Generated blocks that hold the variables and pairs of positive parts, beside the source that contains them."""

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Set

from pyomo_fesd.core import GENERATED, add_part_of_number, declare_positive_part, index_tuple, stored_index

NAME = GENERATED + 'kinks'


class _Sources(AutoSlots.Mixin):
    """Private data of a generated block.

    Attributes
    ----------
    by_pair : ComponentMap
        the source, such as a ConstraintData, that each pair was made for
    """

    __slots__ = ('by_pair',)

    def __init__(self):
        self.by_pair = ComponentMap()


Block.register_private_data_initializer(_Sources, scope='pyomo_fesd.smoothing')


def _pair_sources(block):
    return block.private_data('pyomo_fesd.smoothing').by_pair


def add_to_source(source, number: int, z):
    """Add s = max(0, z), where z has no unit, as positive part ``number`` of a source (a ConstraintData, ...) and return s."""
    block = _find(source) or _declare_positive_parts(source)
    if number not in block.numbers:
        block.numbers.add(number)
    s = add_part_of_number(block, (*index_tuple(source.index()), number), z)
    _pair_sources(block)[block.complementarity[s.index()]] = source
    return s


def last_number(source) -> int:
    """The largest number among the positive parts of ``source``; 0 if it has none."""
    block, index = _find(source), index_tuple(source.index())
    if block is None:
        return 0
    return max((k for k in block.numbers if stored_index((*index, k)) in block.complementarity), default=0)


def source_of(condition):
    """The source that a generated pair was made for."""
    return _pair_sources(condition.parent_block())[condition]


def _find(source):
    """The generated block for the component of ``source``; None if there is none."""
    every = source.parent_block().component(NAME)
    return None if every is None else every.component(source.parent_component().local_name)


def _declare_positive_parts(source):
    """Make the generated block for the component of ``source``; it has a name of its own, which reports leave out."""
    parent, component = source.parent_block(), source.parent_component()
    if parent.component(NAME) is None:
        parent.add_component(NAME, Block())
    block = Block()
    parent.component(NAME).add_component(component.local_name, block)
    block.numbers = Set(dimen=1)
    declare_positive_part(block, *([component.index_set()] if component.is_indexed() else []), block.numbers)
    return block
