"""Keys of expressions: hashable, and equal for expressions that are built alike.

A Disjunction has the same key at every time, and so has another one that the same rule wrote.  The analysis of one is reused for
the others, with their variables exchanged for those of the first one.
"""

import threading
from functools import cache

from pyomo.common.numeric_types import native_types
from pyomo.core import value
from pyomo.core.expr import numeric_expr as nodes
from pyomo.core.expr import relational_expr as relations
from pyomo.core.expr.visitor import ExpressionReplacementVisitor


def no_detail(node) -> None:
    """The detail of operations that their class and the number of their arguments describe."""


#: Operations that are described by their class, the number of their arguments and a detail; subclasses are like them.
DETAILS = {
    nodes.UnaryFunctionExpression: nodes.UnaryFunctionExpression.getname,
    nodes.ExternalFunctionExpression: lambda node: id(node._fcn),
    relations.InequalityExpression: lambda node: node.strict,
    relations.RangedExpression: lambda node: node.strict,
} | dict.fromkeys(
    (nodes.SumExpression, nodes.ProductExpression, nodes.DivisionExpression, nodes.PowExpression, nodes.NegationExpression)
    + (relations.EqualityExpression,),
    no_detail,
)


@cache
def detail_of(cls):
    """Return the function that reads the detail of the nodes of a class; None for a class that is not in ``DETAILS``."""
    return next((detail for known, detail in DETAILS.items() if issubclass(cls, known)), None)


def prefix_tokens(expressions, leaf, number=None) -> tuple:
    """Prefix notation of some expressions together.

    Parameters
    ----------
    expressions : iterable of expressions
    leaf : callable node -> (hashable, sequence of expressions)
        the token of a variable, Param, named Expression or operation that is not in ``DETAILS``, and expressions to enter
    number : callable number -> hashable, optional
        the token of a number, by default the number itself
    """
    tokens, waiting = [], list(expressions)[::-1]
    while waiting:
        node = waiting.pop()
        detail = detail_of(node.__class__)
        if node.__class__ in native_types:
            tokens.append(node if number is None else number(node))
        elif detail is not None:
            arguments = node.args
            tokens.append((node.__class__, len(arguments), detail(node)))
            waiting.extend(arguments[::-1])
        else:
            token, inner = leaf(node)
            tokens.append(token)
            waiting.extend(inner[::-1])
    return tuple(tokens)


def component_key(expr) -> tuple:
    """Return a key that is equal for expressions built alike from the same components and numbers.

    A named Expression counts as one component, since its content may change; so does an operation that is not in ``DETAILS``.
    """
    return prefix_tokens([expr], lambda node: (('id', id(node)), ()))


def expression_key(expressions, kind) -> tuple:
    """Return a key that is equal for expressions built alike from other variables, and the components of the expressions.

    Parameters
    ----------
    expressions : iterable of expressions
    kind : callable VarData -> hashable
        properties of a variable that belong to the key; of a Param its value and its unit belong to it

    Returns
    -------
    hashable or None
        None where the expressions contain an operation that is not in ``DETAILS``
    list of variables, Params and named Expressions, each once
    """
    # every row of a model passes here: a walk of its own takes half the time of ``prefix_tokens``
    tokens, numbers, parts, kinds, waiting = [], {}, [], [], list(expressions)[::-1]
    while waiting:
        node = waiting.pop()
        cls = node.__class__
        if cls in native_types:
            tokens.append(node)
            continue
        detail = detail_of(cls)
        if detail is not None:
            arguments = node.args
            tokens += cls, len(arguments), None if detail is no_detail else detail(node)
            waiting += arguments[::-1]
            continue
        number = numbers.get(id(node))
        if number is None:
            number = numbers[id(node)] = (len(parts),)
            parts.append(node)
            if node.is_variable_type():
                kinds.append(kind(node))
            elif node.is_named_expression_type():
                kinds.append(None)
                waiting.append(node.expr)
            elif node.is_expression_type():
                return None, []
            else:
                kinds.append((value(node, exception=False), str(node.get_units() if node.is_parameter_type() else node)))
        tokens.append(number)
    return (tuple(tokens), tuple(kinds)), parts


class _OfThread(threading.local):
    """A visitor for each thread: Pyomo takes longer to make one than to use it, and it keeps what it exchanges."""

    def __init__(self):
        self.visitor = ExpressionReplacementVisitor()


_OF_THREAD = _OfThread()


def exchanged(expr, others: dict):
    """Return ``expr`` with other components, given by the ids of the present ones; named Expressions are written out."""
    visitor = _OF_THREAD.visitor
    visitor.substitute = others
    return visitor.walk_expression(expr)
