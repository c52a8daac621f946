"""A look at a solution on moving elements: what a user should know that no certificate says."""

import logging

from pyomo_fesd.collapsed import collapsed
from pyomo_fesd.excursions import excursions
from pyomo_fesd.records import records
from pyomo_fesd.switching import switching_functions
from pyomo_fesd.uniqueness import not_unique

logger = logging.getLogger('pyomo_fesd')

#: What is looked for: functions ``(model, wrt, switching functions)`` that give messages.
LOOKS = (not_unique, excursions, collapsed)


def review(model):
    """Warn of what the solution in ``model`` overlooks or leaves open; returns the messages.

    Called by ``mpec_hybrid`` and ``simulate`` for the moving grids on the Block that they solve.
    """
    grids = [wrt for wrt, block in records(model).grids.items() if _is_below(block, model)]
    messages = []
    for wrt in grids:
        functions = switching_functions(model, wrt)
        messages += [message for look in LOOKS for message in look(model, wrt, functions)]
    for message in messages:
        logger.warning(message)
    return messages


def _is_below(block, model):
    while block is not None and block is not model:
        block = block.parent_block()
    return block is model
