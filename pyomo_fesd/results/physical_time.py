"""Physical time of labels and finite elements."""

from __future__ import annotations

import numpy as np
from pyomo.common.dependencies import pandas as pd
from pyomo.core import Block
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import ONE_ELEMENT_SCHEMES, Element, FesdError, discretised, find_continuous_set, moving_grids, read_grid


def physical_time(model: Block, wrt: ContinuousSet | None = None) -> dict[float, float]:
    """Return the physical time of every label of ``wrt``, in order of time.

    With element lengths h_n a label of element n is the time t_{n,0} + c_r h_n, t_{n,0} the sum of the lengths before
    (theory, eq. 9 and 10), in the time of the plant if the final time or the lengths of the control stages are free; on an
    ordinary grid labels are physical time.
    """
    wrt = find_continuous_set(model, wrt, 'physical_time')
    moving = moving_grids(model).get(wrt)
    return {t: float(t) for t in wrt} if moving is None else moving.physical_time()


def elements(wrt: ContinuousSet) -> tuple[Element, ...]:
    """Return the finite elements of a discretised ContinuousSet.

    Raises
    ------
    FesdError
        if it is not discretised
    """
    if not discretised(wrt):
        raise FesdError(wrt, "it is not discretised yet, so there are no elements", "apply fesd.finite_elements first")
    return read_grid(wrt, [wrt.first(), wrt.last()]).elements


def elements_if_any(wrt: ContinuousSet) -> tuple[Element, ...]:
    """Return the finite elements; none on a set that is not discretised, or by a scheme whose equations join two elements."""
    return elements(wrt) if discretised(wrt) and wrt.get_discretization_info()['scheme'] in ONE_ELEMENT_SCHEMES else ()


def element_lengths(model: Block, wrt: ContinuousSet | None = None) -> pd.DataFrame:
    """Return start, end and length of each finite element on physical time.

    Returns
    -------
    pandas.DataFrame, index ``element`` (1..N), columns ``start``, ``end``, ``length`` (h_n of theory, eq. 10)
    """
    wrt = find_continuous_set(model, wrt, 'element_lengths')
    times, found = physical_time(model, wrt), elements(wrt)
    start, end = [times[e.left] for e in found], [times[e.right] for e in found]
    index = pd.Index([e.n for e in found], name='element')
    return pd.DataFrame({'start': start, 'end': end, 'length': np.subtract(end, start)}, index=index)
