"""Continuous nonsmooth functions for the user's own constraints (theory, eq. 8).

    max(a, b) = b + max(0, a - b),    min(a, b) = b - max(0, b - a),    |z| = 2 max(0, z) - z

Takes: the block that is to hold the new components, and the arguments as expressions.
Leaves: one variable and one pair for each max(0, z); none where numbers or declared bounds decide.
Does not apply: to functions that jump, such as x/|x|; over time, outside a Block over time.
"""

from functools import reduce

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import is_constant, value

from pyomo_fesd.core import FesdError, known_sign
from pyomo_fesd.modeling.positive_parts import add_to_block, check_block, next_number


def maximum(block, *args):
    """Return the largest of several arguments, exactly: max(a, b) = b + s with s = max(0, a - b) (theory, eq. 8).

    Adds one variable and one complementarity pair for each argument after the first.  All numbers together count as one
    argument; an argument that can never be the largest, by the bounds of the variables at the time of the call, adds nothing.

    Parameters
    ----------
    block : BlockData
        gets the new components: over time, the block in whose rule the function is called (of a Block over time, or inside
        one); without time, any block
    *args : two or more expressions or numbers

    Returns
    -------
    expression, or number if all arguments are numbers

    Raises
    ------
    FesdError
        if ``block`` is not one block, if it is not over the ContinuousSet that the arguments are over, or if it belongs to
        another model; the model is then unchanged

    Examples
    --------
    >>> @m.Block(m.t)
    ... def weir(b, t):
    ...     b.flow = pyo.Constraint(expr=m.F[t] == 2*pyomo_fesd.maximum(b, 0, m.x[t] - 1))
    """
    return _fold(block, 'maximum', max, _larger, args)


def minimum(block, *args):
    """Return the smallest of several arguments, exactly: min(a, b) = b - s with s = max(0, b - a) (theory, eq. 8).

    Additions, parameters, value and errors are those of ``maximum``.
    """
    return _fold(block, 'minimum', min, _smaller, args)


def absolute(block, z):
    """Return the absolute value, exactly: |z| = 2 s - z with s = max(0, z) (theory, eq. 8).

    Adds one variable and one pair; nothing if declared bounds decide the sign of z.  Parameters, value and errors are those of
    ``maximum``.
    """
    z = _plain(z)
    if _is_number(z):
        return abs(z)
    s, sign = _positive_part(block, z)
    return sign * z if sign else 2 * s - z


def positive_part(block, z):
    """Return max(0, z), exactly (theory, eq. 8).

    Adds one variable and one pair; nothing if declared bounds decide the sign of z.  Parameters, value and errors are those of
    ``maximum``.
    """
    z = _plain(z)
    return max(0, z) if _is_number(z) else _positive_part(block, z)[0]


def clip(block, z, low, high):
    """Return z between two limits, exactly: low + max(0, z - low) - max(0, z - high) (theory, eq. 8).

    Adds two variables and two pairs, fewer where declared bounds decide.  The caller must ensure low <= high; only numbers are
    checked.  Parameters, value and errors are otherwise those of ``maximum``.
    """
    z, low, high = _plain(z), _plain(low), _plain(high)
    if _is_number(low) and _is_number(high) and low > high:
        raise FesdError(block, f"clip: the lower limit {low} is above the upper limit {high}", "exchange them")
    return maximum(block, low, z) - positive_part(block, z - high)


def _fold(block, name, of_numbers, of_two, args):
    """The function of all arguments by that of two; all numbers come first, as one argument."""
    args = [_plain(a) for a in args]
    if len(args) < 2:
        raise FesdError(getattr(block, 'name', str(block)), f"{name} of {len(args)} argument(s)", "give two or more")
    numbers = [a for a in args if _is_number(a)]
    start = [of_numbers(numbers)] if numbers else []
    return reduce(lambda b, a: of_two(block, a, b), start + [a for a in args if not _is_number(a)])


def _larger(block, a, b):
    s, sign = _positive_part(block, a - b)
    return b + s if not sign else a if sign > 0 else b


def _smaller(block, a, b):
    s, sign = _positive_part(block, b - a)
    return b - s if not sign else a if sign > 0 else b


def _positive_part(block, z):
    """max(0, z), and the sign of z if declared bounds decide it, else 0."""
    check_block(block, z)
    number, sign = next_number(block), known_sign(z)
    if sign:
        return (z if sign > 0 else 0), sign
    return add_to_block(block, number, z), 0


def _is_number(a):
    return a.__class__ in native_numeric_types


def _plain(a):
    """``a``, or its number if it is a Param that cannot change."""
    return value(a) if is_constant(a) else a
