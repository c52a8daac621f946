"""Walk over the data of a model where each is declared: a Reference only names data of others again, and reads them slowly.

Takes: a block.
Leaves: nothing.
Does not apply: where the user has named components, which may be References.
"""

from collections.abc import Iterable, Iterator

from pyomo.core import Block, Var


def own_components(block: Block, ctype, descend_into, active: bool | None = None) -> Iterator:
    """Yield the components of type ``ctype`` that are no References; the parameters and the order are those of Pyomo's walks."""
    wanted, places = (set(types) if isinstance(types, tuple) else {types} for types in (ctype, descend_into))
    waiting = [block] if active is None or block.active == active else []
    while waiting:
        place = waiting.pop()
        # most Disjuncts have none of the types, and Pyomo takes twenty times as long to find that out
        if not wanted.isdisjoint(place._ctypes):
            yield from (c for c in place.component_map(wanted, active).values() if not _is_reference(c))
        if not places.isdisjoint(place._ctypes):
            inner = (c for c in place.component_map(places, active).values() if not _is_reference(c))
            waiting += reversed([b for c in inner for b in c.values() if active is None or b.active == active])


def _is_reference(component):
    return component.is_indexed() and component.is_reference()


def own_data(block: Block, ctype, descend_into, active: bool | None = None) -> Iterator:
    """Yield the data of these components."""
    for component in own_components(block, ctype, descend_into, active):
        yield from data_of(component)


def data_of(component) -> Iterable:
    """Return the data of a component."""
    if component.is_indexed():
        return component.values()
    # of a flowsheet over time most are scalar; ``values`` takes three times as long
    return (component,) if len(component) else ()


def variables_below(block: Block, active: bool | None = None) -> Iterator:
    """Yield the variables of a block and those outside of it that a Reference names; a whole model has no others than its own."""
    if block.model() is block:
        return own_data(block, Var, Block, active)
    return block.component_data_objects(Var, active=active, descend_into=Block)
