"""Warn of states that are lost in the tolerances: all their values are tiny beside the size that their start values suggested.

Takes: a solved model and its compiled MPCC.
Leaves: messages.
Does not apply: to states with a ``scaling_factor``, or that are 0 to round-off of that size.
"""

import logging
import sys

from pyomo.common.collections import ComponentMap
from pyomo.core import Block

from pyomo_fesd.core import derivatives, moving_grids

logger = logging.getLogger('pyomo_fesd')

#: A state below this part of the size by which it was scaled is only known to a few digits.
TINY = 1e-5
#: A state below this part of it is 0: a slide along x = 0 leaves 1e-48 on one machine and 0 on another.
ROUND_OFF = sys.float_info.epsilon
MESSAGE = (
    "%s: its values are at most %.1e, but it started from values of size %.1e, to which tolerances are relative: the solution may "
    "be inaccurate. Give start values of its size, none at all, or a scaling_factor."
)


def warn_small_states(model: Block, compiled) -> list[str]:
    """Warn of these states of the moving grids of ``model``; returns the messages."""
    states = ComponentMap((d.get_state_var(), 0.0) for wrt in moving_grids(model) for d in derivatives(model, wrt))
    sizes = ComponentMap()
    for v, factor in zip(compiled.variables, compiled.scale.x if states else ()):
        component = v.parent_component()
        if component in states and v.value is not None:
            states[component] = max(states[component], abs(v.value))
            sizes[component] = max(1 / factor, sizes.get(component, 0.0))
    found = [(c, states[c], size) for c, size in sizes.items() if ROUND_OFF * size < states[c] < TINY * size]
    messages = [MESSAGE % (c.name, now, size) for c, now, size in found]
    for message in messages:
        logger.warning(message)
    return messages
