"""Images: the generated Constraint in the place of a Constraint, or of the equation of a ``Piecewise``.

It stands in a generated block beside its source, under the same name and index; the source is deactivated.
"""

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Constraint

from pyomo_fesd import marks
from pyomo_fesd.dcs.home import part

NAME = marks.GENERATED + 'images'


class _Maps(AutoSlots.Mixin):
    """Private data of a block of images: where each came from."""

    __slots__ = ('sources', 'images')

    def __init__(self):
        self.sources = ComponentMap()
        self.images = ComponentMap()


Block.register_private_data_initializer(_Maps, scope='pyomo_fesd.dcs.images')


def _maps(block):
    return block.private_data('pyomo_fesd.dcs.images')


def image(source):
    """The image of a Constraint or Piecewise; None if there is none."""
    block = source.parent_block().component(NAME)
    return None if block is None else _maps(block).images.get(source)


def source(image):
    """The Constraint or Piecewise that an image stands for; None for other components."""
    block = image.parent_block()
    return _maps(block).sources.get(image) if block.local_name == NAME else None


def write(source, expression, undo):
    """Put ``expression`` in the place of ``source``.

    Where pyomo.dae has built a Piecewise anew, its image is there already.
    """
    component, index = source.parent_component(), source.index()
    block = part(source.parent_block(), NAME, Block, undo)
    sets = (component.index_set(),) if component.is_indexed() else ()
    images = part(block, component.local_name, lambda: Constraint(*sets), undo)
    if index not in images:
        undo.callback(images._data.pop, index, None)
        images.add(index, expression)
    _maps(block).sources[images[index]] = source
    _maps(block).images[source] = images[index]
    switch_off(source, undo)


def switch_off(component, undo):
    """Deactivate a component."""
    if component.active:
        undo.callback(component.activate)
        component.deactivate()
