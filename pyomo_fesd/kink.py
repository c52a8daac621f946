"""The positive part of an expression, the one kink from which all continuous piecewise functions are made (theory, eq. 8).

    s = max(0, z):    0 <= s  perp  s - z >= 0

One variable and one pair, no equation.  max(a, b) = b + max(0, a - b), |z| = 2 max(0, z) - z; a piecewise linear function has
one s for each breakpoint.  Both sides are continuous in time where z is, so a change of side falls on an element boundary.

Takes: a block of its own, and z as an expression.
Leaves: ``s`` and ``complementarity`` on that block.
Does not apply: to functions that jump; they need a multiplier (theory, eq. 5).
"""

from pyomo.core import Var, value
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks


def declare(block, *index):
    """Declare ``s`` and ``complementarity`` on ``block`` over the sets ``index`` (none: scalar)."""
    sparse = {'dense': False} if index else {}
    block.s = Var(*index, **sparse, bounds=(0, None))
    block.complementarity = Complementarity(*index)
    marks.mark(block, marks.CONTINUOUS, block.s, block.complementarity)


def add(block, index, z):
    """Add max(0, z) at ``index`` (a tuple, empty for a scalar); returns the variable s."""
    s = block.s[index or None]
    s.set_value(max(0.0, _now(z)), skip_validation=True)
    block.complementarity.add(index or None, complements(s >= 0, s - z >= 0))
    return s


def _now(z):
    """Value of ``z`` at the present values; 0 where it has none."""
    try:
        now = value(z, exception=False)
    except (ArithmeticError, ValueError):
        return 0.0
    return now if isinstance(now, (int, float)) and abs(now) < float('inf') else 0.0
