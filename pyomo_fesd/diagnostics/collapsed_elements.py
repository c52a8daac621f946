"""Collapsed elements: at its least length an element is a point, where any multiplier is feasible.

So a solution may change there to a mode that does not follow from the dynamics.  It does no harm if the active set is that of the
element before or after it, of which it is then a part.

Takes: a solved model with a moving grid.
Leaves: messages.
Does not apply: to elements that ``simulate`` has made shorter; each of them was solved by itself.
"""

from collections.abc import Iterator

from pyomo.core import Block, value
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import moving_grids
from pyomo_fesd.finite_elements import LEAST
from pyomo_fesd.results import SwitchingFunction, physical_time

#: Relative distance from the least length within which an element counts as collapsed.
AT_LEAST = 1e-2


def collapsed_elements(model: Block, wrt: ContinuousSet, functions: list[SwitchingFunction]) -> Iterator[str]:
    """Yield a message for the first collapsed element."""
    moving = moving_grids(model)[wrt]
    for element in moving.grid.elements:
        collapsed = abs(moving.r[element.n].value - LEAST) <= AT_LEAST * LEAST
        if collapsed and not _continues(moving, element):
            when = physical_time(model, wrt)[element.left]
            yield (
                f"{wrt.name}: element {element.n} has collapsed into a point at time {when:.6g}, where any mode would "
                "do: the solution may not be one. Take another number of elements (nfe)."
            )
            break


def _continues(moving, element):
    """Whether the active set of an element is that of a neighbour."""
    own = _active_set(moving, element.n)
    neighbours = (n for n in (element.n - 1, element.n + 1) if 1 <= n <= len(moving.grid.elements))
    return any(_active_set(moving, n) == own for n in neighbours)


def _active_set(moving, n):
    """Which conditions have lam = 0 in element ``n``, and which modes with hysteresis are on."""
    element = moving.grid.elements[n - 1]
    pairs = () if moving.activity is None else ((key, theta) for key, theta in moving.activity.items() if key[1] == n)
    on = {name: value(theta) > 0.5 for (name, _), theta in pairs if theta.expr is not None}
    modes = [] if moving.hysteresis is None else moving.hysteresis.modes
    return on | {mode.name: value(mode.weight(element)) > 0.5 for mode in modes}
