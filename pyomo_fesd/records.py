"""Private data on the root of a model: transformations to repeat once pyomo.dae has added points, and grids made movable.

Nothing here is needed to solve; all of it survives ``clone``.
"""

from functools import reduce

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, TransformationFactory

from pyomo_fesd.timeindex import discretised


class Records(AutoSlots.Mixin):
    """What the transformations leave for one another and for the reports.

    Attributes
    ----------
    repeats : list of (name, block, ContinuousSet, keywords)
        transformations applied before discretisation
    rewrites : list of (name, block, ContinuousSet)
        transformations whose ``rewriter`` an integrand has to pass, since it is built after them
    grids : ComponentMap ContinuousSet -> Block
        the block with the element lengths of each moving grid
    """

    __slots__ = ('repeats', 'rewrites', 'grids')

    def __init__(self):
        self.repeats = []
        self.rewrites = []
        self.grids = ComponentMap()


Block.register_private_data_initializer(Records, scope='pyomo_fesd.records')


def records(block):
    """The records of the model that ``block`` belongs to."""
    return block.model().private_data('pyomo_fesd.records')


def repeat_after_expansion(block, name, wrt, **keywords):
    """Remember that transformation ``name`` is to be applied again when ``wrt`` has got its points; no-op if it has."""
    if not discretised(wrt):
        records(block).repeats.append((name, block, wrt, keywords))


def repeat(block, wrt):
    """Apply again what was applied before ``wrt`` was discretised; each of them skips what it has already done."""
    repeats = records(block).repeats
    for name, where, over, keywords in repeats:
        if over is wrt:
            TransformationFactory(name).apply_to(where, wrt=wrt, **keywords)
    records(block).repeats = [r for r in repeats if r[2] is not wrt]


def rewrite_integrands(block, name, wrt):
    """Remember that integrands over ``wrt`` that are built from now on have to pass transformation ``name``."""
    rewrites = records(block).rewrites
    if not any(n == name and where is block and over is wrt for n, where, over in rewrites):
        rewrites.append((name, block, wrt))


def rewriter(integral, wrt):
    """A function that sends an integrand of ``integral`` through all that it has to pass."""
    found = [(name, where) for name, where, over in records(integral).rewrites if over is wrt]
    steps = [TransformationFactory(name).rewriter(where, wrt, integral) for name, where in found]
    return lambda expression: reduce(lambda e, step: step(e), steps, expression)
