"""Post-solve diagnostics that the certificate does not cover."""

import logging
from dataclasses import replace
from functools import cache, partial

from pyomo.core import Block
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import moving_grids
from pyomo_fesd.diagnostics.collapsed_elements import collapsed_elements
from pyomo_fesd.diagnostics.missed_crossings import missed_crossings
from pyomo_fesd.diagnostics.uneven_elements import uneven_elements
from pyomo_fesd.diagnostics.uniqueness import not_unique
from pyomo_fesd.diagnostics.unknown_first_modes import unknown_first_modes
from pyomo_fesd.diagnostics.varied_inputs import varied_inputs
from pyomo_fesd.results import switching_functions

logger = logging.getLogger('pyomo_fesd')

#: Functions ``(model, wrt, switching functions)`` that yield messages, by what they look for.
CHECKS = {
    'uniqueness': not_unique,
    'first modes': unknown_first_modes,
    'missed crossings': missed_crossings,
    'collapsed elements': collapsed_elements,
    'uneven elements': uneven_elements,
    'inputs': varied_inputs,
}

#: Those for elements that march along, in the first round and in all others.
AT_FIRST = 'uniqueness', 'first modes', 'missed crossings'
WHILE_MARCHING = 'uniqueness', 'missed crossings'


def diagnose(model: Block) -> list[str]:
    """Log warnings about what the certificate does not cover; return the messages.

    They concern missed crossings, collapsed and uneven elements, inputs that follow labels, and solutions that are not unique.
    Called by ``mpec_hybrid`` and ``simulate`` for the moving grids on the Block that they solve.
    """
    grids = [wrt for wrt, moving in moving_grids(model).items() if _lies_on(moving.block, model)]
    messages = []
    for wrt in grids:
        functions = cache(partial(switching_functions, model, wrt))
        messages += [message for name, check in CHECKS.items() for message in _messages(name, check, model, wrt, functions)]
    for message in messages:
        logger.warning(message)
    return messages


class MarchReview:
    """The review of elements that march along: what the first of them begin with, and what each of them may miss.

    A message is logged once.

    Parameters
    ----------
    model : Block
    wrt : ContinuousSet
    """

    def __init__(self, model: Block, wrt: ContinuousSet):
        self._model, self._wrt, self._said = model, wrt, set()
        self._functions = cache(partial(switching_functions, model, wrt))
        self._named = CHECKS | {'missed crossings': partial(CHECKS['missed crossings'], largest={})}
        self._checks = AT_FIRST

    def look(self) -> None:
        """Log warnings about the elements on the grid."""
        # a function keeps the values of its first use
        functions = cache(lambda: [replace(function) for function in self._functions()])
        for name in self._checks:
            for message in _messages(name, self._named[name], self._model, self._wrt, functions):
                subject = name, message.partition(':')[0]
                if subject not in self._said:
                    self._said.add(subject)
                    logger.warning(message)
        self._checks = WHILE_MARCHING


def _messages(name, check, model, wrt, functions):
    """The messages of one check; one line if it fails, since no review may cost a result."""
    try:
        return list(check(model, wrt, functions()))
    except Exception as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        return [f"{wrt.name}: the solution stands, but it was not reviewed for {name}: {reason}"]


def _lies_on(block, model):
    while block is not None and block is not model:
        block = block.parent_block()
    return block is model
