"""Records in Pyomo's private data, which ``clone``, ``deepcopy`` and ``pickle`` carry along with the block that holds them."""

from collections.abc import Callable, Iterator

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block
from pyomo.gdp import Disjunct

from pyomo_fesd.core.own_data import own_blocks

#: Beginning of the scopes of our records.
OURS = 'pyomo_fesd'
#: Types of blocks with records that are read, and with all that are restored.
BLOCKS, PLACES = {Block}, {Block, Disjunct}
#: Containers in records -> a copy of one.
COPIES = {
    list: list,
    dict: dict,
    ComponentSet: ComponentSet,
    ComponentMap: lambda entries: ComponentMap(entries.items()),
}


def records_below(model: Block, scope: str) -> Iterator[object]:
    """Yield the records of one scope on ``model`` and the active blocks below it, in the order of the blocks.

    Pyomo's own ``private_data`` creates an empty record on every block that it is asked for; this function only reads.
    """
    for block in own_blocks(model, BLOCKS, active=True):
        # pyomo.dae adds active data to a Block that is deactivated as a whole
        if block._private_data and scope in block._private_data and block.parent_component().active:
            yield block._private_data[scope]


def remember_records(model: Block) -> Callable[[], None]:
    """Return a function that gives every record on ``model`` and below the entries that it has now, and removes new records."""
    known = [(block, scope, record, _entries(record)) for block, scope, record in _all_records(model)]

    def restore():
        for block, scope, _ in list(_all_records(model)):
            del block._private_data[scope]
        for block, scope, record, entries in known:
            for name, entry in entries.items():
                setattr(record, name, entry)
            block._private_data[scope] = record

    return restore


def _all_records(model):
    for block in own_blocks(model, PLACES):
        for scope, record in (block._private_data or {}).items():
            if scope.startswith(OURS):
                yield block, scope, record


def _entries(record):
    """The entries of a record, containers copied."""
    found = ((name, getattr(record, name)) for name in type(record).__slots__)
    return {name: COPIES.get(type(entry), lambda same: same)(entry) for name, entry in found}
