"""Run a round on the user's own model and undo it unless it is kept: values, stale flags and components are then as before.

A clone would not help: rules that close over the model (``lambda d, t: m.x[t] ...``) refer to the original.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from pyomo.core import Block
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import restored_on_error, withheld_messages


class _Undo(Exception):
    """Ends a round that is not kept."""


class TrialRound:
    """Whether a round is kept."""

    kept = False

    def keep(self) -> None:
        """Leave the model as it is now."""
        self.kept = True


@contextmanager
def trial_round(model: Block, wrt: ContinuousSet) -> Iterator[TrialRound]:
    """Undo all changes of the body to ``model``, also after an error, unless it calls ``keep`` of the ``TrialRound``.

    Warnings are withheld until the round is kept.
    """
    trial = TrialRound()
    with suppress(_Undo), withheld_messages('pyomo_fesd') as messages, restored_on_error(model, wrt):
        yield trial
        if not trial.kept:
            raise _Undo
    for record in messages if trial.kept else ():
        logging.getLogger(record.name).handle(record)
