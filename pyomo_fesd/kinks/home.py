"""Where the variables and pairs of kinks go: generated blocks beside what asked for them."""

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Set
from pyomo.core.base.block import BlockData
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import ContinuousSet

from pyomo_fesd import kink, marks
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import refuse_foreign


class _Home(AutoSlots.Mixin):
    """Private data of a block.

    Attributes
    ----------
    asked : int
        on a user's block: how many kinks were asked for
    source : ComponentMap
        on a generated block: what each pair was made for, such as a ConstraintData
    """

    __slots__ = ('asked', 'source')

    def __init__(self):
        self.asked = 0
        self.source = ComponentMap()


Block.register_private_data_initializer(_Home, scope='pyomo_fesd.kinks')


def _private(block):
    return block.private_data('pyomo_fesd.kinks')


def continuous_sets(data):
    """The ContinuousSets that index ``data`` or a block around it."""
    found = ComponentSet()
    while data is not None and data.parent_block() is not None:
        component = data.parent_component()
        if component.is_indexed():
            found.update(s for s in component.index_set().subsets() if s.ctype is ContinuousSet)
        data = data.parent_block()
    return found


def check(block, z):
    """Refuse a block on which a kink at z could not be followed over time.

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
        for wrt in continuous_sets(v):
            if wrt not in known:
                raise FesdError(
                    block,
                    f"'{v.name}' is a function of '{wrt.name}' and this block is not, so a kink could not be followed over "
                    f"'{wrt.name}'",
                    f"call it in the rule of a Block over '{wrt.name}', with the block of that rule as first argument; for one "
                    "single time, give the value a Var of its own",
                )


def next_number(block):
    """The number of the next kink on a user's block.

    Kinks that bounds decide are counted too, so that the same kink has the same number at all times.
    """
    private = _private(block)
    private.asked += 1
    return private.asked


def add_to_block(block, number, z):
    """s = max(0, z) for the kink ``number`` of a user's block, in a generated block of its own."""
    home = Block()
    _generated(block, 'functions').add_component(f'kink_{number}', home)
    kink.declare(home)
    return kink.add(home, (), z)


def add_for_source(source, number, z):
    """s = max(0, z) for the kink ``number`` of a source (a ConstraintData, ...), in a block beside it."""
    home = _home(source)
    home.numbers.add(number)
    s = kink.add(home, (*_index(source), number), z)
    _private(home).source[home.complementarity[s.index()]] = source
    return s


def kinks_of(source):
    """How many numbers are taken by the kinks that ``source`` has."""
    home, index = _find(source), _index(source)
    if home is None:
        return 0
    return max((k for k in home.numbers if ((*index, k) if index else k) in home.complementarity), default=0)


def source_of(condition):
    """What a generated pair was made for."""
    return _private(condition.parent_block()).source[condition]


def _index(source):
    """The index of ``source`` as a tuple; empty for a scalar."""
    index = source.index()
    return () if index is None else index if isinstance(index, tuple) else (index,)


def _generated(block, name):
    """The generated block ``name`` on ``block``, made if there is none.

    What lies in it has names of its own: reports leave out the names of generated blocks.
    """
    found = block.component(marks.GENERATED + name)
    if found is None:
        found = Block()
        block.add_component(marks.GENERATED + name, found)
    return found


def _find(source):
    """The block of all kinks of the component of ``source``; None if it has none."""
    everything = source.parent_block().component(marks.GENERATED + 'kinks')
    return None if everything is None else everything.component(source.parent_component().local_name)


def _home(source):
    """The same, made if there is none."""
    home = _find(source)
    if home is None:
        home, component = Block(), source.parent_component()
        _generated(source.parent_block(), 'kinks').add_component(component.local_name, home)
        home.numbers = Set(dimen=1)
        kink.declare(home, *([component.index_set()] if component.is_indexed() else []), home.numbers)
    return home
