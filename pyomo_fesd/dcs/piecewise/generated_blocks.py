"""Generated blocks for the variables of piecewise functions, one for each quantity that they depend on.

The block of a quantity is the same at all times, so that its conditions are one component over time.  It has the name of the
quantity; its ``doc`` gives the quantity in words, and its Expression ``arguments`` holds it at each time.
"""

import re

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, Expression, RangeSet, Var
from pyomo.core.expr.compare import compare_expressions
from pyomo.core.expr.visitor import expression_to_string
from pyomo.mpec import Complementarity

from pyomo_fesd.core import GENERATED, index_tuple, strip_time, switched_systems
from pyomo_fesd.dcs.source_maps import source_maps

#: Characters of a quantity that make up the name of its block.
LONGEST_NAME = 40


class GeneratedBlocks:
    """The blocks of all quantities, in the generated block ``name`` on ``instance``.

    Parameters
    ----------
    instance : BlockData
    name : str
        without the prefix of generated blocks
    times : TimeIndex
    undo : ExitStack
        receives callbacks that undo all changes
    """

    def __init__(self, instance, name, times, undo):
        self._instance, self._name = instance, GENERATED + name
        self.times, self.undo = times, undo
        self._entries = None

    @property
    def wrt(self):
        """The ContinuousSet."""
        return self.times.wrt

    def blocks(self):
        """Return the blocks of all quantities."""
        parent = self._instance.component(self._name)
        return list(parent.component_objects(Block, descend_into=False)) if parent is not None else []

    def entries(self, time):
        """Return ``(arguments, block)`` of every quantity at one time."""
        if self._entries is None:
            self._entries = self._read()
        return self._entries.setdefault(time, [])

    def existing(self, time, arguments, key):
        """Return the block with this ``key`` and the same arguments at ``time``; None if there is none."""
        found = (
            block
            for known, block in self.entries(time)
            if source_maps(block).key == key and all(map(compare_expressions, arguments, known))
        )
        return next(found, None)

    def new(self, time, arguments, text, key=None):
        """Return the block for a new quantity at ``time``: that of the same text and key at other times, or a new one."""
        here = self.entries(time)
        taken = ComponentSet(block for _, block in here)
        free = (block for block in self.blocks() if block.doc == text and source_maps(block).key == key and block not in taken)
        block = next(free, None) or self._declare(text, key, len(arguments))
        for k, argument in enumerate(arguments, start=1):
            self.undo.callback(block.arguments._data.pop, (time, k))
            block.arguments[time, k] = argument
        here.append((tuple(arguments), block))
        return block

    def name(self, component):
        """Return the name of a component, the same at all times."""
        return strip_time(self.times.split(component)[1]).removeprefix(f'{self._name}.')

    def text(self, q):
        """Return a quantity in words, the same at all times."""
        return expression_to_string(q, labeler=self.name)

    def component_of(self, block, name, declare):
        """Return ``component_of`` with the undo of these blocks."""
        return component_of(block, name, declare, self.undo)

    def _read(self):
        """The entries that the model has."""
        found = {}
        for block in self.blocks():
            held = {}
            for (time, _), argument in sorted(block.arguments.items()):
                # pyomo.dae gives an Expression all its indices
                if argument.expr is not None:
                    held.setdefault(time, []).append(argument.expr)
            for time, arguments in held.items():
                found.setdefault(time, []).append((tuple(arguments), block))
        return found

    def _declare(self, text, key, count):
        parent = self.component_of(self._instance, self._name, Block)
        plain = re.sub(r'\W+', '_', text).strip('_')[:LONGEST_NAME] or 'quantity'
        name, number = plain, 1
        while parent.component(name) is not None:
            number += 1
            name = f'{plain}_{number}'
        block = self.component_of(parent, name, Block)
        block.doc, source_maps(block).key = text, key
        block.count = RangeSet(count)
        block.arguments = Expression(self.wrt, block.count, rule=lambda *_: Expression.Skip)
        return block


def component_of(block, name, declare, undo):
    """Return component ``name`` of a block; made by ``declare()`` the first time."""
    if block.component(name) is None:
        undo.callback(block.del_component, name)
        block.add_component(name, declare())
    return block.component(name)


def delete_data(block, index: tuple) -> None:
    """Delete the data at ``index`` (the beginning of an index) from the components of a block, and from its record."""
    gone = ComponentSet()
    for component in block.component_objects((Var, Constraint, Complementarity), descend_into=False):
        for key in [key for key in component._data if index_tuple(key)[: len(index)] == index]:
            gone.add(component._data.pop(key))
    switched_systems(block).forget(gone)
