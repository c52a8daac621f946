"""Starts that a shifted plan does not know: simulations with each control held at one level over the whole horizon.

A branch of the shifted plan is a local solution.  With levels a in [0, 1] and bounds l <= u <= h of each control,

    u_a(t) := l + a (h - l),    a = 0, 1/(n-1), .., 1,

the simulated objectives of n levels say whether a far better plan exists: each of them is that of a trajectory of the model.

Takes: controls with two bounds.
Leaves: the best level; the values of the model are those of the last simulation.
"""

from collections.abc import Sequence

from pyomo.core import Block, Var, value

from pyomo_fesd.core import FesdError
from pyomo_fesd.mpcc import Deadline
from pyomo_fesd.simulation import simulate


class HeldControls:
    """Levels of controls that are held over the horizon, and the objective of each.

    Parameters
    ----------
    model : Block
    controls : list of Var
    wrt : ContinuousSet
    number : int
        of levels, at least 2

    Raises
    ------
    FesdError
        for fewer levels, and for a control without two bounds
    """

    def __init__(self, model: Block, controls: Sequence[Var], wrt, number: int):
        if number < 2:
            raise FesdError('levels', f"Controller: {number} levels of the controls", "give at least 2, or None")
        for u in controls:
            if any(None in v.bounds for v in u.values()):
                raise FesdError(u.name, "Controller: levels need a lower and an upper bound", "give it two bounds, or levels=None")
        self._model, self._controls, self._wrt = model, controls, wrt
        self._levels = [k / (number - 1) for k in range(number)]

    def best(self, objective, deadline: Deadline) -> tuple[float | None, float | None]:
        """Return the objective of the best simulation before the deadline and its level; (None, None) if there is none."""
        reached = ((self._simulated(level, objective, deadline), level) for level in self._levels)
        found = [pair for pair in reached if pair[0] is not None]
        return min(found, key=lambda pair: objective.sense * pair[0], default=(None, None))

    def hold(self, level: float) -> None:
        """Give all controls this level."""
        for v in (v for u in self._controls for v in u.values() if not v.fixed):
            low, high = v.bounds
            v.set_value(low + level * (high - low))

    def _simulated(self, level, objective, deadline):
        if deadline.expired():
            return None
        self.hold(level)
        try:
            simulate(self._model, self._wrt, inputs=self._controls, time_limit=deadline.left())
        except FesdError:
            return None  # e.g. a state that leaves the range of an equation: no start
        return value(objective)
