"""Walk over the data of a model where each is declared: a Reference only names data of others again, and reads them slowly.

Takes: a block.
Leaves: nothing.
Does not apply: where the user has named components, which may be References.
"""

from collections.abc import Iterator

from pyomo.core import Block, Var


def own_data(block: Block, ctype, descend_into, active: bool | None = None) -> Iterator:
    """Yield the data of the components of type ``ctype`` that are no References; the parameters are those of Pyomo's walks."""
    for component in block.component_objects(ctype, active=active, descend_into=descend_into):
        if not component.is_indexed():
            # of a flowsheet over time most are scalar; ``values`` takes three times as long
            if len(component):
                yield component
        elif not component.is_reference():
            yield from component.values()


def variables_below(block: Block, active: bool | None = None) -> Iterator:
    """Yield the variables of a block and those outside of it that a Reference names; a whole model has no others than its own."""
    if block.model() is block:
        return own_data(block, Var, Block, active)
    return block.component_data_objects(Var, active=active, descend_into=Block)
