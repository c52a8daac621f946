"""``Plant``: the simulated plant of a closed loop, one sampling interval after the other.

Takes: a model on a moving grid whose horizon is one sampling interval, with its states and modes with hysteresis at the first time.
Leaves: the values of the last interval in the model, and the trajectory of all.
"""

from collections.abc import Sequence

from pyomo.common.dependencies import pandas as pd
from pyomo.contrib.mpc import ScalarData
from pyomo.core import Block, Var
from pyomo.dae import ContinuousSet

from pyomo_fesd.control.moving_interface import MovingModelInterface
from pyomo_fesd.control.states import first_states
from pyomo_fesd.core import TimeIndex
from pyomo_fesd.simulation import simulate


class Plant:
    """A plant that is simulated from one sampling time to the next, with parameters of its own (mismatch).

    Parameters
    ----------
    model : Block
        after ``fesd.finite_elements``, over one sampling interval; between two intervals its Params and inputs may change
    controls : list of Var
        inputs over time, which ``advance`` sets
    wrt : ContinuousSet, optional
    options : options of ``simulate``

    Attributes
    ----------
    model : Block
    time : float
        passed since the beginning

    Raises
    ------
    FesdError
        as ``MovingModelInterface``
    """

    def __init__(self, model: Block, controls: Sequence[Var], wrt: ContinuousSet | None = None, **options):
        self._interface = MovingModelInterface(model, wrt)
        self.model, self._controls, self._options, self.time, self._parts = model, list(controls), options, 0.0, []
        times = TimeIndex(self._interface.time)
        self._states = [(times.split(v)[1], v, times.at(v, self._interface.time.last())) for v in first_states(model, times.wrt)]

    @property
    def measured(self) -> ScalarData:
        """The states at the present time, as ``Controller.step`` takes them."""
        return ScalarData({name: v.value for name, v, _ in self._states})

    @property
    def modes(self) -> list[str]:
        """Names of the modes with hysteresis at the present time, as ``Controller.step`` takes them."""
        return self._interface.modes_at_first_time()

    def advance(self, controls) -> pd.DataFrame:
        """Simulate one sampling interval with held ``controls`` (ScalarData or dict); returns its trajectory on the time passed.

        Raises
        ------
        FesdError
            as ``simulate``
        """
        self._interface.load_data(controls)
        found = simulate(self.model, self._interface.time, inputs=self._controls, **self._options)
        found.index = found.index - self._interface.time.first() + self.time
        self._parts.append(found)
        self.time += self._interface.time.last() - self._interface.time.first()
        self._interface.load_modes(self._interface.modes_at_end())
        for _, first, last in self._states:
            first.set_value(last.value)
        return found

    def trajectory(self) -> pd.DataFrame:
        """Return the trajectory of all sampling intervals, on the time passed."""
        return pd.concat(self._parts)
