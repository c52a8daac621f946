"""Fixed points: element boundaries inside a control stage that keep their physical time.

Between switches the elements of a control stage are equal, so a transient much shorter than the stage gets elements of its own only
behind a boundary that keeps its time.  At a fixed point elements on both sides differ in length, and nothing else changes: an input
in ``piecewise_constant`` keeps its value.

Takes: labels, and the ContinuousSet before it is discretised.
Leaves: the points in the ContinuousSet.
Does not apply: to a model that is discretised already; its fixed points are element boundaries that it has.
"""

from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError


def check_fixed_points(points: list[float], wrt: ContinuousSet) -> None:
    """Refuse points outside of the horizon, and those that are boundaries of control stages.

    Raises
    ------
    FesdError
    """
    for t in points:
        if not wrt.first() < t < wrt.last():
            raise FesdError(wrt, f"fixed_points: {t:g} is not inside of [{wrt.first():g}, {wrt.last():g}]", "give labels inside")
        if t in wrt:
            raise FesdError(wrt, f"fixed_points: {t:g} is a boundary of control stages, which keeps its time", "leave it out")


def add_fixed_points(points: list[float], wrt: ContinuousSet) -> None:
    """Add the points to ``wrt``."""
    for t in set(points):
        wrt.add(t)
