"""What expressions are worth, where they may have no value, and what may change it."""

from math import isfinite, nan

from pyomo.core import value
from pyomo.core.expr.visitor import identify_mutable_parameters


def number(expr):
    """Value of ``expr`` at the present values of its variables; NaN where it has none."""
    try:
        found = None if expr is None else value(expr, exception=False)
    except (ArithmeticError, ValueError, NotImplementedError):
        # Pyomo cannot evaluate a PiecewiseLinearFunction
        found = None
    return nan if found is None or isinstance(found, complex) else found


def finite(expr):
    """The same, 0 where that is no finite number."""
    found = number(expr)
    return found if isfinite(found) else 0.0


def mutable_parameters(expr):
    """The mutable Params of ``expr``; Pyomo's own function takes units for such."""
    return (p for p in identify_mutable_parameters(expr) if p.is_parameter_type())
