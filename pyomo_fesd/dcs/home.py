"""Where the variables of functions in pieces go: one generated block, in it a block for each quantity that they depend on.

The block of a quantity is the same at all times, so that the elements see its conditions as one family over time.  It bears the
name of the quantity, and its ``doc`` tells the quantity in words.
"""

import re

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, Suffix, Var
from pyomo.core.expr.visitor import expression_to_string
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.timeindex import strip_time

#: Characters of a quantity that make up the name of its block.
LONGEST_NAME = 40


class _Known(AutoSlots.Mixin):
    """Private data of the generated block.

    Attributes
    ----------
    entries : dict (kind, time) -> list of (key, Block)
        the quantities at each time
    names : dict (kind, text) -> list of str
        names of the blocks of the quantities with that text, of which there may be several at one time
    """

    __slots__ = ('entries', 'names')

    def __init__(self):
        self.entries = {}
        self.names = {}


Block.register_private_data_initializer(_Known, scope='pyomo_fesd.dcs.home')


class Home:
    """The generated block on ``instance``.

    Parameters
    ----------
    instance : BlockData
    times : TimeIndex
    undo : ExitStack
        is told how to take back what is written
    """

    NAME = marks.GENERATED + 'pieces'

    def __init__(self, instance, times, undo):
        self._instance, self.times, self.undo = instance, times, undo

    @property
    def wrt(self):
        """The ContinuousSet."""
        return self.times.wrt

    def entries(self, kind, time):
        """All ``(key, block)`` of one kind at one time."""
        return self._known().entries.get((kind, time), ())

    def new(self, kind, time, key, text):
        """The block for a new ``key`` at ``time``: that of the quantity with the same text at other times, or a new one."""
        known = self._known()
        here = known.entries.setdefault((kind, time), [])
        taken = [block.local_name for _, block in here]
        free = (n for n in known.names.get((kind, text), ()) if n not in taken)
        block = self._block().component(next(free, None) or self._declare(kind, text))
        here.append((key, block))
        self.undo.callback(here.pop)
        return block

    def blocks(self):
        """The blocks of all quantities."""
        home = self._instance.component(self.NAME)
        return home.component_objects(Block, descend_into=False) if home is not None else ()

    def name(self, component):
        """The name of a component, the same at all times."""
        return strip_time(self.times.split(component)[1]).removeprefix(f'{self.NAME}.')

    def text(self, q):
        """A quantity in words, the same at all times."""
        return expression_to_string(q, labeler=self.name)

    def part(self, block, name, declare):
        """Component ``name`` of the block of a quantity; made by ``declare()`` and added at its first time."""
        if block.component(name) is None:
            self.undo.callback(block.del_component, name)
            block.add_component(name, declare())
        return block.component(name)

    def _known(self):
        return self._block().private_data('pyomo_fesd.dcs.home')

    def _block(self):
        return self.part(self._instance, self.NAME, Block)

    def _declare(self, kind, text):
        block, known = self._block(), self._known()
        plain = re.sub(r'\W+', '_', text).strip('_')[:LONGEST_NAME] or 'quantity'
        name, number = plain, 1
        while block.component(name) is not None:
            number += 1
            name = f'{plain}_{number}'
        self.part(block, name, Block).doc = text
        known.names.setdefault((kind, text), []).append(name)
        self.undo.callback(known.names[kind, text].remove, name)
        return name


def forget(block, index):
    """Take what stands at ``index`` (the beginning of an index) out of the components of a block, and its marks."""
    gone = ComponentSet()
    for component in block.component_objects((Var, Constraint, Complementarity), descend_into=False):
        for key in [key for key in component._data if (key if isinstance(key, tuple) else (key,))[: len(index)] == index]:
            gone.add(component._data.pop(key))
    for suffix in block.component_objects(Suffix, descend_into=False):
        for component in [component for component in suffix if component in gone]:
            del suffix[component]
