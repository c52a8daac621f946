"""Start from a simulation where nothing is free (option ``simulate_first``).

The room ``simulation`` lies above this one and uses its solvers; it registers what is called here.

Takes: a model, the options, and the deadline of the run.
Leaves: the simulated values in the model; after a failure, on ``restore``, and where the run ends with a
FesdError, the values of before.
"""

import time
from collections.abc import Callable

from pyomo.core import Block, Var
from pyomo.gdp import Disjunct

from pyomo_fesd.core import FesdError, withheld_messages
from pyomo_fesd.mpcc import Deadline

#: Part of the time limit that a simulation may take.
SHARE = 0.5
#: What ``register_simulation`` was given.
_registered = []


def register_simulation(simulation: Callable) -> None:
    """Let ``simulation`` look for starts.

    Parameters
    ----------
    simulation : callable (model, demanded, timer, seconds) -> bool
        writes the values of a simulation into the model; False where it does not apply, a FesdError where it fails; ``demanded``
        also asks for one where something is free
    """
    _registered.append(simulation)


class SimulatedStart:
    """The start of one run.

    Attributes
    ----------
    found : bool
        whether the model has the values of a simulation
    note : str
        for the log and for the reason of a failure; empty where no simulation applies
    """

    def __init__(self, model: Block, options, deadline: Deadline):
        self.found, self.note, self._before = False, '', []
        if options.simulate_first is False or options.warm_start or options.mode != 'hybrid' or model.model() is not model:
            return
        variables = model.component_data_objects(Var, descend_into=(Block, Disjunct))
        self._before = [(v, v.value, v.stale) for v in variables]
        try:
            self._simulate(model, options, deadline)
        finally:
            if not self.found:
                self.restore()

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if kind is not None and issubclass(kind, FesdError):
            self.restore()

    def _simulate(self, model, options, deadline):
        began, seconds = time.perf_counter(), None if deadline.at is None else SHARE * deadline.left()
        try:
            with withheld_messages('pyomo_fesd'):
                self.found = any(one(model, options.simulate_first is True, options.timer, seconds) for one in _registered)
            if self.found:
                self.note = f"simulated first in {time.perf_counter() - began:.2f} s (simulate_first): the values are the start"
        except FesdError as error:
            self.note = f"simulated first (simulate_first), without success: {error.component}: {error.cause}"

    def restore(self) -> None:
        """Give the model the values of before."""
        for v, number, stale in self._before:
            if v.value != number:
                v.set_value(number, skip_validation=True)
            v.stale = stale
