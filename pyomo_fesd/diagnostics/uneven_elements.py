"""Uneven elements: between two switches elements are much longer than others, of which one could be spared.

Step equilibration makes lengths equal between two switches; how many elements lie there is left to the solver, and the order of
the switches is the same for all such solutions.  The error is that of the longest element.

Takes: a solved model with a moving grid.
Leaves: messages.
Does not apply: where there are too few elements for the switches.
"""

from collections.abc import Iterator
from itertools import groupby

from pyomo.core import Block
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import moving_grids
from pyomo_fesd.results import SwitchingFunction

#: Elements so many times as long as the others would be with one element less are too long.
LONGER = 5.0
#: Relative difference of equal lengths, as a number of digits.
DIGITS = 4


def uneven_elements(model: Block, wrt: ContinuousSet, functions: list[SwitchingFunction]) -> Iterator[str]:
    """Yield a message for the longest elements of each control stage if they are too long."""
    moving = moving_grids(model)[wrt]
    if moving.equilibration is None:
        return
    time = moving.physical_time()
    for elements in moving.grid.stages.values():
        lengths = [(time[e.right] - time[e.left], e) for e in elements]
        whole = sum(h for h, _ in lengths)
        groups = [list(group) for _, group in groupby(lengths, key=lambda pair: round(pair[0] / whole, DIGITS))]
        spared = [group[0][0] * len(group) / (len(group) - 1) for group in groups if len(group) > 1]
        longest = max(groups, key=lambda group: group[0][0])
        if spared and longest[0][0] > LONGER * min(spared):
            yield (
                f"{wrt.name}: the elements from time {time[longest[0][1].left]:.6g} to {time[longest[-1][1].right]:.6g} are "
                f"{longest[0][0] / min(h for h, _ in lengths):.2g} times as long as the shortest, so the error there is larger "
                "than this number of elements promises. Take another one (nfe), or refine."
            )
