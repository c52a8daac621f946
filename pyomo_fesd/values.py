"""Values of expressions that may have none."""

from math import isfinite, nan

from pyomo.core import value


def number(expr):
    """Value of ``expr`` at the present values of its variables; NaN where it has none."""
    try:
        found = None if expr is None else value(expr, exception=False)
    except (ArithmeticError, ValueError):
        found = None
    return nan if found is None or isinstance(found, complex) else found


def finite(expr):
    """The same, 0 where that is no finite number."""
    found = number(expr)
    return found if isfinite(found) else 0.0
