"""Evaluate expressions that may be undefined, and read their signs and mutable Params."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from math import isfinite, nan

import numpy as np
from pyomo.common.errors import InfeasibleConstraintException, IntervalException
from pyomo.common.numeric_types import native_numeric_types
from pyomo.contrib.fbbt.expression_bounds_walker import ExpressionBoundsVisitor
from pyomo.core import value
from pyomo.core.base.expression import ExpressionData, ScalarExpression
from pyomo.core.base.var import VarData
from pyomo.core.expr import (
    AbsExpression,
    DivisionExpression,
    LinearExpression,
    MonomialTermExpression,
    NegationExpression,
    PowExpression,
    ProductExpression,
    SumExpression,
    UnaryFunctionExpression,
)
from pyomo.core.expr.visitor import identify_mutable_parameters

from pyomo_fesd.core.interruption import DeferredInterrupt
from pyomo_fesd.core.node_search import leaves_of

#: Nodes that are evaluated without Pyomo's visitor, which takes longer to set up than they do.
EVALUATED = {
    *(LinearExpression, MonomialTermExpression, NegationExpression, ProductExpression, SumExpression),
    *(DivisionExpression, PowExpression, UnaryFunctionExpression, AbsExpression, ExpressionData, ScalarExpression),
}


def number_of(expr) -> float:
    """Return the value of an expression as Pyomo's ``value`` does, in half of its time where it consists of sums and products."""
    found = _number(expr)
    return value(expr) if found is None else found


def _number(expr):
    """The value, or None where a variable has none or a function is undefined."""
    kind = expr.__class__
    if kind is VarData:
        return expr.value
    if kind not in EVALUATED:
        return expr if kind in native_numeric_types else value(expr, exception=False)
    try:
        return expr._apply_operation([_number(arg) for arg in expr.args])
    except (TypeError, ValueError):
        return None
    except RecursionError:
        return value(expr, exception=False)


def numbers_of(expr, values: Mapping) -> np.ndarray | float | None:
    """Return the values of an expression at several points; None where a function is undefined at one, or takes numbers only.

    Parameters
    ----------
    values : mapping id of a variable -> array
    """
    try:
        with np.errstate(all='raise', under='ignore'):
            return _numbers(expr, values)
    except (ArithmeticError, TypeError, ValueError, RecursionError):
        return None


def _numbers(expr, values):
    kind = expr.__class__
    if kind in EVALUATED:
        return expr._apply_operation([_numbers(arg, values) for arg in expr.args])
    if kind in native_numeric_types:
        return expr
    if expr.is_expression_type():
        raise TypeError(expr)
    return values[id(expr)] if id(expr) in values else value(expr)


def value_or_nan(expr) -> float:
    """Value of ``expr`` at the present values of its variables; NaN where it is undefined."""
    try:
        found = None if expr is None else _number(expr)
    except (ArithmeticError, ValueError, NotImplementedError):
        # Pyomo cannot evaluate a PiecewiseLinearFunction
        found = None
    return nan if found is None or isinstance(found, complex) else found


def value_or_zero(expr) -> float:
    """Value of ``expr`` at the present values of its variables; 0 where it is undefined or infinite."""
    found = value_or_nan(expr)
    return found if isfinite(found) else 0.0


@contextmanager
def kept_values(variables: Iterable):
    """Put back the values and stale flags of ``variables`` when the body is left."""
    kept = [(v, v.value, v.stale) for v in variables]
    with DeferredInterrupt() as interrupt:
        try:
            with interrupt.raising():
                yield
        finally:
            for v, number, stale in kept:
                v.set_value(number, skip_validation=True)
                v.stale = stale


def mutable_parameters(expr):
    """Yield the mutable Params of ``expr``, without the units that Pyomo's own function yields too."""
    return (p for p in identify_mutable_parameters(expr) if p.is_parameter_type())


def known_sign(z) -> int:
    """Return 1 if z >= 0 wherever the declared bounds hold, -1 if z <= 0 there, 0 if the bounds do not decide.

    A fixed Var counts with its declared bounds and a mutable Param as unknown: both may have another value later.
    """
    if any(True for _ in mutable_parameters(z)):
        return 0
    try:
        low, high = ExpressionBoundsVisitor().walk_expression(z)
    except (InfeasibleConstraintException, IntervalException, ArithmeticError, KeyError):
        return 0  # no interval arithmetic for a function in z, or none that fits its bounds
    return 1 if low >= 0 else -1 if high <= 0 else 0


def variables_that_count(expression) -> Iterator[VarData]:
    """Yield the variables of an expression, without terms with a factor that is fixed to 0, as a gain that is not used."""
    waiting = [expression]
    while waiting:
        node = waiting.pop()
        if node.__class__ in native_numeric_types:
            continue
        if node.is_variable_type():
            yield node
        elif node.is_expression_type() and not _vanishes(node):
            waiting.extend(node.args)


def _vanishes(node):
    """Whether a product has a factor that is fixed to 0."""
    return isinstance(node, ProductExpression) and any(map(_is_fixed_to_zero, node.args))


def _is_fixed_to_zero(factor):
    if factor.__class__ in native_numeric_types:
        return factor == 0
    if factor.__class__ is VarData:
        return factor.fixed and factor.value == 0
    return not any(v.is_variable_type() and not v.fixed for v in leaves_of(factor)) and value_or_nan(factor) == 0
