"""Warn of kinks and jumps over time that no transformation has taken: elements do not find them.

    |z|, min, max   kinks where z = 0;    ceil, floor   jumps;    tanh(k z), |k| >= 100   a jump that is smoothed

Takes: the expressions over time of a model, after all transformations.
Leaves: one warning with the components and the calls that take them.
Does not apply: to arguments whose sign the bounds decide, or that do not vary.
"""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core.expr import numeric_expr as ne

from pyomo_fesd.core import known_sign, strip_time, value_or_nan

logger = logging.getLogger('pyomo_fesd')

#: A factor in tanh(k z) from which it is meant as a step.
STEEP = 100.0
#: Components that one warning names.
SHOWN = 5
ABSOLUTE = "fesd.smooth_to_complementarity before this, or pyomo_fesd.absolute"
EXTREME = "pyomo_fesd.maximum or pyomo_fesd.minimum"
STEPS = "a Disjunction with one region for each value"
STEP = "a Disjunction with the two sides of the step"


def warn_untaken_kinks(expressions: Iterable[tuple[str, Mapping[float, Callable]]]) -> None:
    """Warn of the kinks in ``(name, {time: function that gives expressions and relations})``."""
    found = {}
    for name, by_time in expressions:
        for function, remedy in _kinks(next(reversed(by_time.values()))()):
            found.setdefault((strip_time(name), function), remedy)
    if found:
        shown = [f"{name} ({function}: {remedy})" for (name, function), remedy in found.items()]
        more = f"; and {len(shown) - SHOWN} more" if len(shown) > SHOWN else ""
        logger.warning(
            "no element boundary will lie where these functions have a kink or a jump, and their integration is inaccurate there: "
            "%s%s. Take them with the call in brackets, if their arguments reach such a point.",
            '; '.join(shown[:SHOWN]),
            more,
        )


def _kinks(stated) -> Iterator[tuple[str, str]]:
    """``(function, remedy)`` for every kink in some expressions and relations."""
    waiting = list(stated)
    while waiting:
        node = waiting.pop()
        if hasattr(node, 'is_expression_type') and node.is_expression_type():
            waiting.extend(node.args)
            rule = RULES.get(node.__class__)
            if rule is not None and not node.is_fixed():
                yield from rule(node)


def _absolute(node):
    if known_sign(node.arg(0)) == 0:
        yield 'abs', ABSOLUTE


def _unary(node):
    name = node.getname()
    if name in ('ceil', 'floor'):
        yield name, STEPS
    elif name == 'tanh' and _factor(node.arg(0)) >= STEEP:
        yield 'a steep tanh', STEP


def _factor(z):
    """The size of the constant factors in front of z."""
    if isinstance(z, ne.NegationExpression):
        return _factor(z.arg(0))
    if isinstance(z, ne.ProductExpression):
        a, b = z.args
        return _number(a) * _factor(b) if _is_constant(a) else _factor(a)
    if isinstance(z, ne.DivisionExpression) and _is_constant(z.arg(1)):
        return _factor(z.arg(0)) / (_number(z.arg(1)) or 1.0)
    return 1.0


def _is_constant(e):
    return e.__class__ in native_numeric_types or e.is_fixed()


def _number(e):
    return abs(value_or_nan(e))


#: Expression type -> function from a node to its kinks.
RULES = {
    ne.AbsExpression: _absolute,
    ne.UnaryFunctionExpression: _unary,
    ne.MaxExpression: lambda node: [('max', EXTREME)],
    ne.MinExpression: lambda node: [('min', EXTREME)],
}
