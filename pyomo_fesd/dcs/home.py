"""Where the variables of functions in pieces go: a generated block, in it a block for each quantity that they depend on.

The block of a quantity is the same at all times, so that the elements see its conditions as one family over time.  It bears the
name of the quantity; its ``doc`` tells the quantity in words, and its Expression ``arguments`` holds it at each time.
"""

import re

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, Expression, RangeSet, Suffix, Var
from pyomo.core.expr.visitor import expression_to_string
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.timeindex import strip_time

#: Characters of a quantity that make up the name of its block.
LONGEST_NAME = 40


class Home:
    """The generated block ``name`` on ``instance``.

    Parameters
    ----------
    instance : BlockData
    name : str
        without the prefix of generated blocks
    times : TimeIndex
    undo : ExitStack
        is told how to take back what is written
    """

    def __init__(self, instance, name, times, undo):
        self._instance, self._name = instance, marks.GENERATED + name
        self.times, self.undo = times, undo
        self._entries = None

    @property
    def wrt(self):
        """The ContinuousSet."""
        return self.times.wrt

    def blocks(self):
        """The blocks of all quantities."""
        home = self._instance.component(self._name)
        return list(home.component_objects(Block, descend_into=False)) if home is not None else []

    def entries(self, time):
        """``(arguments, block)`` of every quantity at one time."""
        if self._entries is None:
            self._entries = self._read()
        return self._entries.setdefault(time, [])

    def new(self, time, arguments, text):
        """The block for a new quantity at ``time``: that of the quantity with the same text at other times, or a new one."""
        here = self.entries(time)
        taken = ComponentSet(block for _, block in here)
        free = (block for block in self.blocks() if block.doc == text and block not in taken)
        block = next(free, None) or self._declare(text, len(arguments))
        for k, argument in enumerate(arguments, start=1):
            self.undo.callback(block.arguments._data.pop, (time, k))
            block.arguments[time, k] = argument
        here.append((tuple(arguments), block))
        return block

    def name(self, component):
        """The name of a component, the same at all times."""
        return strip_time(self.times.split(component)[1]).removeprefix(f'{self._name}.')

    def text(self, q):
        """A quantity in words, the same at all times."""
        return expression_to_string(q, labeler=self.name)

    def part(self, block, name, declare):
        """``part`` with the undo of this home."""
        return part(block, name, declare, self.undo)

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

    def _declare(self, text, count):
        home = self.part(self._instance, self._name, Block)
        plain = re.sub(r'\W+', '_', text).strip('_')[:LONGEST_NAME] or 'quantity'
        name, number = plain, 1
        while home.component(name) is not None:
            number += 1
            name = f'{plain}_{number}'
        block = self.part(home, name, Block)
        block.doc = text
        block.count = RangeSet(count)
        block.arguments = Expression(self.wrt, block.count, rule=lambda *_: Expression.Skip)
        return block


def part(block, name, declare, undo):
    """Component ``name`` of a block; made by ``declare()`` and added at its first time."""
    if block.component(name) is None:
        undo.callback(block.del_component, name)
        block.add_component(name, declare())
    return block.component(name)


def forget(block, index):
    """Take what stands at ``index`` (the beginning of an index) out of the components of a block, and its marks."""
    gone = ComponentSet()
    for component in block.component_objects((Var, Constraint, Complementarity), descend_into=False):
        for key in [key for key in component._data if (key if isinstance(key, tuple) else (key,))[: len(index)] == index]:
            gone.add(component._data.pop(key))
    for suffix in block.component_objects(Suffix, descend_into=False):
        for component in [component for component in suffix if component in gone]:
            del suffix[component]
