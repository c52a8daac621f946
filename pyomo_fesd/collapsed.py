"""Collapsed elements: at the least length that an element may have it is a point, where any multiplier would do.

So a solution may pass there from one mode to another that does not follow.

Takes: a solved model with a moving grid.
Leaves: messages.
Does not apply: to elements that ``simulate`` has made shorter; each of them was solved by itself.
"""

from pyomo_fesd.elements.cross import grid_of
from pyomo_fesd.elements.lengths import LEAST
from pyomo_fesd.records import records
from pyomo_fesd.trajectory import physical_time

#: An element is at its least length within this part of it.
AT_LEAST = 1e-2


def collapsed(model, wrt, functions):
    """A message for the first collapsed element."""
    block = records(model).grids[wrt]
    for element in grid_of(block).elements:
        if abs(block.r[element.n].value - LEAST) <= AT_LEAST * LEAST:
            when = physical_time(model, wrt)[element.left]
            yield (
                f"{wrt.name}: element {element.n} has collapsed into a point at time {when:.6g}, where any mode would "
                "do: the solution may not be one. Take another number of elements (nfe)."
            )
            break
