"""``MovingModelInterface``: Pyomo's ``DynamicModelInterface`` for a model on a moving grid."""

from collections.abc import Iterable

from pyomo.common.modeling import NOTSET
from pyomo.contrib.mpc import DynamicModelInterface, IntervalData
from pyomo.contrib.mpc.data.convert import _process_to_dynamic_data
from pyomo.core import Block
from pyomo.dae import ContinuousSet

from pyomo_fesd.control.first_modes import FirstModes
from pyomo_fesd.control.shift import SAME, Shift
from pyomo_fesd.core import FesdError, find_continuous_set, moving_grids


class MovingModelInterface(DynamicModelInterface):
    """Data into and out of a model whose elements move, with the methods of ``pyomo.contrib.mpc.DynamicModelInterface``.

    The labels of the ContinuousSet are nominal times: only the first time and the boundaries of control stages keep their physical
    time.  ``load_data`` and ``get_data_at_time`` work there as Pyomo's do; ``shift_values_by_time`` moves all values, also lengths
    of elements, multipliers of modes, jumps and hysteresis, on physical time.

    Parameters
    ----------
    model : Block
        after ``fesd.finite_elements``
    wrt : ContinuousSet, optional
    context : Block, optional
        names in data are relative to it; by default to ``model``

    Raises
    ------
    FesdError
        for a model without a moving grid
    """

    def __init__(self, model: Block, wrt: ContinuousSet | None = None, context=NOTSET):
        wrt = find_continuous_set(model, wrt, 'MovingModelInterface')
        if wrt not in moving_grids(model):
            raise FesdError(wrt, "MovingModelInterface: its elements are not movable", "apply fesd.finite_elements first")
        super().__init__(model, wrt, context)
        self.moving, self._shifts = moving_grids(model)[wrt], {}
        self._first_modes = FirstModes(self.moving)

    @property
    def stage(self) -> float:
        """Duration of the first control stage."""
        elements = self.moving.grid.control_stages[0]
        return elements[-1].right - elements[0].left

    @property
    def mode_multipliers(self) -> list:
        """The fixed multipliers of modes with hysteresis at the first time: parameters that ``load_modes`` sets."""
        return self._first_modes.multipliers

    def shift_values_by_time(self, dt: float | None = None) -> None:
        """Move all values by ``dt``, a number of control stages (by default one), towards the first time.

        What comes after the end of the horizon continues its last values (``shift``).

        Raises
        ------
        FesdError
            for another time, a free final time, and control stages that differ; nothing is moved then
        """
        dt = self.stage if dt is None else float(dt)
        if dt not in self._shifts:
            self._shifts[dt] = Shift(self.moving, dt)
        self._shifts[dt].apply()

    def load_data(self, data, time_points=None, **options) -> None:
        """Load data as ``DynamicModelInterface.load_data`` does; intervals must be made of whole control stages.

        Raises
        ------
        FesdError
            for an interval that ends inside of a control stage, where a label has no given physical time
        """
        data = _process_to_dynamic_data(data, time_set=self.time)
        if isinstance(data, IntervalData):
            self._refuse_inner_ends(data)
        super().load_data(data, time_points, **options)

    def _refuse_inner_ends(self, data):
        first, last = self.time.first(), self.time.last()
        known = [*(e.left for e in self.moving.grid.elements if e.inputs_change), last]
        for end in (end for interval in data.get_intervals() for end in interval):
            near = min(known, key=lambda label: abs(label - end))
            if first <= end <= last and abs(near - end) > SAME * self.stage:
                raise FesdError(
                    self.time,
                    f"load_data: an interval ends at {end:g}, inside of a control stage, where elements move",
                    f"let it end at {near:g}, or add {end:g} to the ContinuousSet before the discretisation",
                )

    def load_modes(self, modes: Iterable) -> None:
        """Load the modes with hysteresis that are active at the first time.

        Parameters
        ----------
        modes : list of Disjunct or str
            one for each system that is to be set, e.g. ``[m.heating]``, or by name without time, ``['heating']``

        Raises
        ------
        FesdError
            for what is no disjunct with hysteresis, two of one system, and a mode that is not fixed at the first time
        """
        self._first_modes.load(modes)

    def modes_at_first_time(self) -> list[str]:
        """Return the names of the modes with hysteresis that are active at the first time."""
        return self._first_modes.present()

    def modes_at_end(self) -> list[str]:
        """Return the names of the modes with hysteresis that are active at the last time."""
        return self._first_modes.at_end()
