"""The other side of the surface of a contact: where a line along its normal meets it again.

Takes: a ``ContactLaw`` with values of the positions at the first time.
Leaves: the step along the gradient from one side to the other.
Does not apply: where the gap, or a position, has no value there.
"""

import numpy as np
from pyomo.core import value
from pyomo.core.expr.calculus.derivatives import differentiate

from pyomo_fesd.core import kept_values, value_or_nan

#: Newton's steps to the surface, and what is left of the gap there, relative to the gradient.
STEPS, LEFT = 20, 1e-6
#: Another side is looked for so many times as far away as the inverse of the second derivatives, at so many places; an even number
#: of them, so that none is on the surface itself.
FARTHEST, PLACES = 8.0, 200


def step_to_other_side(law, equations, times) -> float | None:
    """Return |s|, where gap(q + s grad gap) is zero again, from where the surface is nearest to the first positions q.

    None where there is no other side.
    """
    gap = next(gap for t, gap in law.gaps.items() if t != times.wrt.first())
    positions, slopes = equations.positions(gap), [slope for _, slope in equations.gradient(gap)]
    starts = [times.at(v, times.wrt.first()) for v in positions]
    with kept_values(positions):
        _move(positions, [start.value for start in starts])
        try:
            return _from_surface(gap, positions, slopes)
        except (ArithmeticError, ValueError, TypeError):
            return None


def _from_surface(gap, positions, slopes):
    for _ in range(STEPS):
        gradient = np.array([value(slope) for slope in slopes])
        size = float(gradient @ gradient)
        if not size > 0.0:
            return None
        _move(positions, _values(positions) - value(gap) / size * gradient)
    bend = _bend(positions, slopes)
    if abs(value(gap)) > LEFT * size**0.5 or not bend > 0.0:
        return None
    here, steps = _values(positions), FARTHEST / bend * np.linspace(-1.0, 1.0, PLACES)
    gaps = [_gap_at(gap, positions, here + s * gradient) for s in steps]
    # a change of sign between two steps in one direction is beyond the surface itself
    between = [(a, b, g, k) for a, b, g, k in zip(steps, steps[1:], gaps, gaps[1:]) if a * b > 0 > g * k]
    return min((abs(a - g * (b - a) / (k - g)) for a, b, g, k in between), default=None)


def _bend(positions, slopes):
    """The norm of the second derivatives of the gap."""
    second = [differentiate(slope + 0 * positions[0], wrt_list=positions) for slope in slopes]
    return float(np.linalg.norm(np.array(second, dtype=float), 2))


def _gap_at(gap, positions, numbers):
    _move(positions, numbers)
    return value_or_nan(gap)


def _values(positions):
    return np.array([v.value for v in positions])


def _move(positions, numbers):
    for v, number in zip(positions, numbers):
        v.set_value(number, skip_validation=True)
