"""``Expr_if`` on states, by a step function (theory, eq. 5).

    Expr_if(q > b, THEN, ELSE) = ELSE + alpha (THEN - ELSE)

with alpha the step function of q - b, 1 where the condition holds.  Where q stays at b, alpha takes the value between 0 and 1
that keeps it there.  If THEN - ELSE = f (q - b), the expression is continuous: ELSE + f max(0, q - b), which costs one variable and
one pair.

    l < q < u:   alpha_l + alpha_u - 1            and:   alpha_1 alpha_2            not:   1 - alpha

Takes: ``Expr_if`` whose condition compares expressions; ``<`` and ``<=`` are the same.
Leaves: the expression; conditions on the same boundary share one multiplier.
Does not apply: to conditions without variables, which Pyomo evaluates itself, and to ``==``.
"""

from math import prod

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import value
from pyomo.core.expr import (
    AndExpression,
    InequalityExpression,
    NotExpression,
    OrExpression,
    RangedExpression,
    identify_variables,
)
from pyomo.core.expr.numeric_expr import NPV_Expr_ifExpression

from pyomo_fesd.core import FesdError


def call(node, args, context):
    """Return the expression that replaces an ``Expr_if``; ``args`` are its condition, THEN and ELSE."""
    condition, then, otherwise = args
    difference = then - otherwise
    if not any(True for _ in identify_variables(condition, include_fixed=True)):
        # Pyomo evaluates it each time that the model is solved
        return otherwise + NPV_Expr_ifExpression((condition, 1, 0)) * difference
    if difference.__class__ in native_numeric_types and difference == 0:
        return otherwise
    if condition.__class__ is InequalityExpression:
        q, level, sign = _boundary(condition)
        factor = context.slope_of_difference(then, otherwise, q, level)
        if factor is not None:
            # the branch for q < level, and the difference to the other one
            return (otherwise if sign > 0 else then) + sign * factor * context.positive_part(q, level)
    return otherwise + _weight(condition, context) * difference


def _boundary(inequality):
    """q, b and a sign: ``low <= high`` holds where sign (q - b) > 0."""
    low, high = inequality.args
    if low.__class__ in native_numeric_types:
        return high, low, 1
    if high.__class__ in native_numeric_types:
        return low, high, -1
    return high - low, 0.0, 1


def _weight(condition, context):
    """1 where a condition holds, 0 where it does not."""
    rule = WEIGHTS.get(condition.__class__)
    if rule is None:
        raise FesdError(
            context.owner,
            f"the condition '{condition}' of an Expr_if is not an inequality",
            "compare two expressions with <= or >=, joined by land, lor and lnot",
        )
    return rule(condition, context)


def _inequality(condition, context):
    return context.indicator(*_boundary(condition))


def _ranged(condition, context):
    low, q, high = condition.args
    if value(low) >= value(high):
        raise FesdError(context.owner, f"the range '{condition}' of an Expr_if is empty", "give the smaller bound first")
    return sum(_weight(c, context) for c in (low <= q, q <= high)) - 1


def _and(condition, context):
    return prod(_weight(c, context) for c in condition.args)


def _or(condition, context):
    return 1 - prod(1 - _weight(c, context) for c in condition.args)


def _not(condition, context):
    return 1 - _weight(condition.args[0], context)


WEIGHTS = {
    InequalityExpression: _inequality,
    RangedExpression: _ranged,
    AndExpression: _and,
    OrExpression: _or,
    NotExpression: _not,
}
