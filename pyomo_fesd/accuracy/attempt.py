"""A round on the user's own model, taken back unless it is kept: the model is then as it was, down to stale flags.

A clone would do no better: rules that close over the model (``lambda d, t: m.x[t] ...``) mean the original.
"""

import logging
from contextlib import ExitStack, contextmanager

from pyomo.core import Block, BooleanVar, Var
from pyomo.dae import DerivativeVar
from pyomo.gdp import Disjunct

from pyomo_fesd.elements.restore import restored_on_error


class _TakenBack(Exception):
    """Ends an attempt that is not kept."""


class Attempt:
    """What a round says of itself."""

    kept = False

    def keep(self):
        """Leave the model as it is now."""
        self.kept = True


@contextmanager
def attempt(model, wrt):
    """Take back all that the body does to ``model``, or an error out of it leaves, unless it calls ``keep`` of what is yielded.

    Warnings are held back until it does.
    """
    now = Attempt()
    with ExitStack() as undo:
        undo.callback(_remember_values(model.model()))
        try:
            with _warnings_held_back(now), restored_on_error(model, wrt):
                yield now
                if not now.kept:
                    raise _TakenBack
        except _TakenBack:
            return
        undo.pop_all()


@contextmanager
def _warnings_held_back(now):
    logger, held = logging.getLogger('pyomo_fesd'), []

    def hold(record):
        held.append(record)
        return False

    logger.addFilter(hold)
    try:
        yield
    finally:
        logger.removeFilter(hold)
        for record in held if now.kept else ():
            logger.handle(record)


def _remember_values(model):
    """Values, stale flags and what is fixed; the discretisation looks only after those that it touches itself."""
    # the binaries of indicators come last: they set the Booleans
    found = [
        v for ctype in (BooleanVar, DerivativeVar, Var) for v in model.component_data_objects(ctype, descend_into=(Block, Disjunct))
    ]
    known = [(v, v.value, v.stale, v.fixed) for v in found]

    def restore():
        for v, was, _, fixed in known:
            if v.value != was:
                v.set_value(was, skip_validation=True)
            v.fixed = fixed
        for v, _, stale, _ in known:
            v.stale = stale

    return restore
