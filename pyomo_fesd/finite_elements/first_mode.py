"""Refuse a beginning outside of the region of the first mode with hysteresis, or beyond the guard of a state jump.

    c_ik(x_0) >= 0  for the mode i that is fixed at the first time,   guard(x_0) >= 0

Nothing can leave such a point: no law moves a state into the region before the first element begins.

Takes: the record of a moving grid, and values at the first time.
Leaves: nothing.
"""

from collections.abc import Callable, Iterator

from pyomo.core import Block
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import FesdError, MovingGrid, moving_grids, value_or_nan

#: A condition holds down to this value, relative to its variables and to 1.
OUTSIDE = -1e-6


def value_if_fixed(expr) -> float:
    """Return the value of ``expr`` where all its variables are fixed; NaN elsewhere."""
    return value_or_nan(expr) if all(v.fixed for v in identify_variables(expr)) else value_or_nan(None)


def refuse_first_modes(model: Block) -> None:
    """Check every grid of ``model`` as far as values at its first time are fixed; see ``refuse_first_mode``."""
    for moving in moving_grids(model).values():
        refuse_first_mode(moving, value_if_fixed)


def refuse_first_mode(moving: MovingGrid, evaluate: Callable = value_or_nan) -> None:
    """Refuse a first mode whose region does not hold at the first time, and a guard that is negative there.

    Parameters
    ----------
    moving : MovingGrid
    evaluate : callable
        value of an expression, NaN where it is not known

    Raises
    ------
    FesdError
        names the mode, the condition with its value, and the time
    """
    first = moving.wrt.first()
    for name, role, c, fix in _first_conditions(moving, first):
        size = max((abs(v.value) for v in identify_variables(c) if v.value is not None), default=0.0)
        if evaluate(c) < OUTSIDE * max(1.0, size):
            raise FesdError(name, f"{role} at time {first:g}, but there {c} = {evaluate(c):.6g} is negative", fix)


def _first_conditions(moving, first) -> Iterator[tuple]:
    """``(name, role, condition, remedy)`` of all that must hold at the first time."""
    for mode in moving.hysteresis.modes if moving.hysteresis is not None else ():
        if first in mode.weights and value_if_fixed(mode.weights[first].expr) > 0.5:
            for c in mode.conditions[first]:
                yield (
                    mode.title,
                    "its region must hold, as its indicator is fixed to True",
                    c,
                    ("fix the indicator of the mode that is active there before fesd.dcs, or correct the state"),
                )
    for law in moving.state_jumps.laws if moving.state_jumps is not None else ():
        if first in law.guards:
            yield law.name, "its guard must not be negative", law.guards[first], "correct the state, or the sign of the guard"
