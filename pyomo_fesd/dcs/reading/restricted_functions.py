"""Functions whose arguments have to lie in a domain, found in an expression, and the terms and factors of expressions."""

from pyomo.common.collections import ComponentSet
from pyomo.core.expr import numeric_expr as nodes
from pyomo.core.expr.visitor import identify_variables

#: Domains of functions as sides (s, o): s e + o >= 0 for the argument e.
SIDES = {
    'sqrt': ((1, 0.0),),
    'log': ((1, 0.0),),
    'log10': ((1, 0.0),),
    'acosh': ((1, -1.0),),
    'asin': ((1, 1.0), (-1, 1.0)),
    'acos': ((1, 1.0), (-1, 1.0)),
    'atanh': ((1, 1.0), (-1, 1.0)),
    'power': ((1, 0.0),),
    'reciprocal': ((1, 0.0), (-1, 0.0)),
}


def restricted(node) -> tuple | None:
    """Return the kind of a restricted function (a key of ``SIDES``) and its argument; None for any other node."""
    if isinstance(node, nodes.UnaryFunctionExpression):
        return (node.name, node.args[0]) if node.name in SIDES else None
    if isinstance(node, nodes.DivisionExpression):
        return 'reciprocal', node.args[1]
    if isinstance(node, nodes.PowExpression):
        base, exponent = node.args
        number = exponent if exponent.__class__ in (int, float) else None
        if number is None or number != int(number):
            return 'power', base
        return ('reciprocal', base) if number < 0 else None
    return None


def factors_of(expression) -> list:
    """Return the factors of a product; the expression itself if it is none."""
    if isinstance(expression, nodes.NegationExpression):
        return [-1, *factors_of(expression.args[0])]
    if isinstance(expression, nodes.ProductExpression):
        return [factor for arg in expression.args for factor in factors_of(arg)]
    if isinstance(expression, nodes.DivisionExpression):
        return [*factors_of(expression.args[0]), 1 / expression.args[1]]
    return [expression]


def arguments_of(expression) -> list:
    """Return ``(node, kind, argument)`` of every restricted function whose argument has variables, in a fixed order."""
    found = ((node, restricted(node)) for node in _operations(expression))
    return [(node, *known) for node, known in found if known is not None and has_variables(known[1])]


def _operations(expression):
    """The operations of an expression, each after its arguments, in less time than a visitor of Pyomo takes."""
    found, waiting = [], [expression]
    while waiting:
        node = waiting.pop()
        if hasattr(node, 'is_expression_type') and node.is_expression_type():
            found.append(node)
            waiting.extend(node.args)
    return found[::-1]


def has_variables(expression) -> bool:
    """Whether an expression contains variables, also fixed ones."""
    return hasattr(expression, 'is_expression_type') and any(True for _ in identify_variables(expression, include_fixed=True))


def split(body, defined) -> tuple:
    """Return the terms of a sum that contain ``defined`` variables, and those that do not."""
    known = ComponentSet(defined)
    groups = [], []
    for term in _terms(body):
        groups[not any(v in known for v in identify_variables(term, include_fixed=True))].append(term)
    return tuple(map(sum, groups))


def _terms(body, sign=1):
    if isinstance(body, nodes.SumExpression):
        return [term for arg in body.args for term in _terms(arg, sign)]
    if isinstance(body, nodes.NegationExpression):
        return _terms(body.args[0], -sign)
    return [sign * body]
