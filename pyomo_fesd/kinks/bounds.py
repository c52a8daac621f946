"""Which side of a kink is the only possible one, from the bounds of the variables.

A fixed Var counts with its declared bounds and a mutable Param as unknown: both may have another value later.
"""

from pyomo.common.errors import InfeasibleConstraintException, IntervalException
from pyomo.contrib.fbbt.expression_bounds_walker import ExpressionBoundsVisitor

from pyomo_fesd.values import mutable_parameters


def known_sign(z):
    """1 if z >= 0 wherever the declared bounds hold, -1 if z <= 0 there, 0 if they do not tell."""
    if any(True for _ in mutable_parameters(z)):
        return 0
    try:
        low, high = ExpressionBoundsVisitor().walk_expression(z)
    except (InfeasibleConstraintException, IntervalException, ArithmeticError, KeyError):
        return 0  # no interval arithmetic for a function in z, or none that fits its bounds
    return 1 if low >= 0 else -1 if high <= 0 else 0
