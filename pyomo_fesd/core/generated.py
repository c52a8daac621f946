"""Recognise the blocks that the package generates, and name their contents for users."""

from pyomo_fesd.core.time_index import strip_time

#: Blocks that the package generates are named with this prefix; the user's own components never are.
GENERATED = '_pyomo_fesd_'


def is_generated(component) -> bool:
    """Whether ``component`` is, or lies in, a block that one of the transformations generated."""
    # this is asked for every constraint of a model: a loop takes half of the time of any() over a generator
    block = component.parent_block()
    while block is not None:
        if component.parent_component().local_name.startswith(GENERATED):
            return True
        component, block = block, block.parent_block()
    return False


def public_name(name: str) -> str:
    """Return the name of a component over time as reports show it: without time and without generated blocks."""
    return '.'.join(_public_parts(name))


def source_name(name: str) -> str:
    """Return the name of the Disjunction, or of another source, of a generated component over time."""
    parts = _public_parts(name)
    return '.'.join(parts[:-1]) or parts[-1]


def _public_parts(name):
    return [part for part in strip_time(name).split('.') if not part.startswith(GENERATED)]
