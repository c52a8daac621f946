"""Walk over the data of a model where each is declared: a Reference only names data of others again, and reads them slowly.

Takes: a block.
Leaves: nothing.
Does not apply: where the user has named components, which may be References.
"""

from collections.abc import Callable, Collection, Iterable, Iterator
from operator import itemgetter

from pyomo.core import Block, Var
from pyomo.core.base.block import BlockData

#: Place of the number of components of a type in Pyomo's table of the types of a block.
COUNT = 2


def own_components(
    block: Block, ctype, descend_into, active: bool | None = None, enter: Callable[[BlockData], bool] | None = None
) -> Iterator:
    """Yield the components of type ``ctype`` that are no References; the parameters and the order are those of Pyomo's walks.

    Parameters
    ----------
    enter : function BlockData -> bool, optional
        whether to search a block below
    """
    wanted, places = (set(types) if isinstance(types, tuple) else {types} for types in (ctype, descend_into))
    met, waiting = wanted | places, [block] if active is None or block.active == active else []
    while waiting:
        place = waiting.pop()
        yield from _of_state(declared(place, wanted), active)
        # Disjuncts are many, and most have none of the types
        inner = _of_state(declared(place, places), active)
        found = [b for c in inner for b in data_of(c) if not met.isdisjoint(b._ctypes) and (enter is None or enter(b))]
        waiting += [b for b in reversed(found) if active is None or b.active == active]


def _of_state(components, active):
    """Those that are no References, and are active or not as wanted."""
    return (c for c in components if not is_reference(c) and (active is None or c.active == active))


def declared(block: Block, types: Collection) -> Iterable:
    """Return the components of some ``types`` on ``block`` itself, in the order of their declaration."""
    # most blocks have none, or a few: Pyomo takes longer to make a map than to follow its own list
    ordered, first, found = block._decl_order, block._ctypes, []
    for ctype in types:
        place = first[ctype][0] if ctype in first else None
        while place is not None:
            component, following = ordered[place]
            # one that was deleted leaves None
            if component is not None:
                found.append((place, component))
            place = following
    if len(types) > 1:
        found.sort(key=itemgetter(0))
    return [component for _, component in found]


def count_of(block: Block, ctype) -> int:
    """Return how many components of one type a block itself has declared, by Pyomo's own count."""
    return block._ctypes[ctype][COUNT] if ctype in block._ctypes else 0


def is_reference(component) -> bool:
    """Return whether a component only names data of others again."""
    return component.is_indexed() and component.is_reference()


def own_blocks(block: Block, descend_into: Collection, active: bool | None = None) -> Iterator[BlockData]:
    """Yield ``block`` and the blocks below it of the types ``descend_into``, each before those inside it."""
    waiting = [block] if active is None or block.active == active else []
    while waiting:
        place = waiting.pop()
        yield place
        found = [b for c in declared(place, descend_into) if not is_reference(c) for b in data_of(c)]
        waiting += [b for b in reversed(found) if active is None or b.active == active]


def own_data(block: Block, ctype, descend_into, active: bool | None = None) -> Iterator:
    """Yield the data of these components."""
    for component in own_components(block, ctype, descend_into, active):
        yield from data_of(component)


def data_of(component) -> Iterable:
    """Return the data of a component."""
    # of a flowsheet over time most are scalar; ``values`` takes three times as long, and makes a Set where any index may be
    if not component.is_indexed():
        return (component,) * len(component)
    data, indices = component._data, component._index_set
    if data.__class__ is not dict:
        return component.values()
    if not indices.isfinite():
        return list(data.values())
    return list(map(data.__getitem__, indices)) if len(data) == len(indices) else component.values()


def entries_of(component) -> Iterable:
    """Return the indices of an indexed component with their data."""
    # an index of a Reference is not that of its data
    return component.items() if component.is_reference() else ((data._index, data) for data in data_of(component))


def variables_below(block: Block, active: bool | None = None, descend_into=Block) -> Iterator:
    """Yield the variables of a block and those outside of it that a Reference names; a whole model has no others than its own."""
    if block.model() is block:
        return own_data(block, Var, descend_into, active)
    return block.component_data_objects(Var, active=active, descend_into=descend_into)
