"""``receding_horizon``: the closed loop of a ``Controller`` and a ``Plant``."""

from collections.abc import Callable

from pyomo.common.dependencies import pandas as pd

from pyomo_fesd.control.controller import Controller
from pyomo_fesd.control.plant import Plant
from pyomo_fesd.core import interruptible


@interruptible
def receding_horizon(
    controller: Controller,
    plant: Plant,
    steps: int,
    before: Callable[[int], None] | None = None,
    time_limit: float | None = None,
    advanced: bool = False,
) -> pd.DataFrame:
    """Close the loop: measure, solve, apply the first control stage to the plant, again and again.

    Parameters
    ----------
    controller : Controller
    plant : Plant
        simulated over one control stage of the controller
    steps : int
    before : callable (number of the step), optional
        called before each step, to change references, bounds or disturbances in either model
    time_limit : float, optional
        seconds for each step
    advanced : bool
        prepare the next plan for the predicted state while a control is applied, and only correct it when the measurement is
        there (``Controller.prepare``)

    Returns
    -------
    pandas.DataFrame
        a row for each step, by its time: the ``ControlStep`` without its results, its controls by name, and with ``advanced`` the
        seconds of the preparation that follows; ``plant.trajectory()`` has the states

    Raises
    ------
    FesdError
        as ``Controller.step`` and ``Plant.advance``
    """
    rows = {}
    for number in range(steps):
        if before is not None:
            before(number)
        answer = controller.step(plant.measured, plant.modes, time_limit)
        rows[plant.time] = answer.row()
        if advanced:
            rows[plant.time]['prepared'] = controller.prepare(time_limit).seconds
        plant.advance(answer.controls)
    return pd.DataFrame.from_dict(rows, orient='index').rename_axis('time')
