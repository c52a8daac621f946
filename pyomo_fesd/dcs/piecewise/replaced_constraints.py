"""Replace a Constraint, or the equation of a ``Piecewise``, by a generated Constraint.

It lies in a generated block beside its source, under the same name and index; the source is deactivated.
"""

from pyomo.core import Block, Constraint

from pyomo_fesd.core import GENERATED
from pyomo_fesd.dcs.piecewise.generated_blocks import component_of
from pyomo_fesd.dcs.source_maps import source_maps

NAME = GENERATED + 'replaced'


def replacement_of(source):
    """Return the Constraint that replaces a Constraint or Piecewise; None if there is none."""
    block = source.parent_block().component(NAME)
    return None if block is None else next(iter(source_maps(block).replacements.get(source, ())), None)


def replace_constraint(source, expression, undo) -> None:
    """Replace ``source`` by a Constraint with ``expression``.

    Where pyomo.dae has built a Piecewise anew, its replacement exists already.
    """
    component, index = source.parent_component(), source.index()
    block = component_of(source.parent_block(), NAME, Block, undo)
    sets = (component.index_set(),) if component.is_indexed() else ()
    replacements = component_of(block, component.local_name, lambda: Constraint(*sets), undo)
    if index not in replacements:
        undo.callback(replacements._data.pop, index, None)
        replacements.add(index, expression)
    maps, replacement = source_maps(block), replacements[index]
    maps.sources[replacement], maps.replacements[source] = [source], [replacement]
    deactivate(source, undo)


def deactivate(component, undo) -> None:
    """Deactivate a component until ``undo``."""
    if component.active:
        undo.callback(component.activate)
        component.deactivate()
