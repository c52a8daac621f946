"""Search the nodes of an expression, quicker than a visitor of Pyomo can.

Takes: an expression; classes of nodes.
Leaves: nothing.
"""

from collections.abc import Iterator
from functools import cache

from pyomo.common.numeric_types import native_types
from pyomo.core.base.expression import NamedExpressionData
from pyomo.core.expr.base import ExpressionBase

_LEAF, _OPERATION, _NAMED, _SOUGHT = range(4)


def contains_node(expr, sought: frozenset, enter=None) -> bool:
    """Whether ``expr`` is or contains a node whose class is in ``sought``.

    Parameters
    ----------
    sought : frozenset of classes
        of nodes other than named Expressions
    enter : function ExpressionData -> bool, optional
        whether to search in this named Expression.  Default: a named Expression counts as found.
    """
    waiting = [expr]
    while waiting:
        node = waiting.pop()
        sort = _sort(node.__class__, sought)
        if sort is _SOUGHT or (sort is _NAMED and enter is None):
            return True
        if sort is _OPERATION or (sort is _NAMED and enter(node)):
            waiting.extend(node.args)
    return False


def leaves_of(expr) -> Iterator:
    """Yield the variables, Params and units in ``expr`` from left to right, as often as they occur."""
    waiting = [expr]
    while waiting:
        node = waiting.pop()
        if node.__class__ in native_types:
            continue
        if node.is_expression_type():
            waiting.extend(node.args[::-1])
        else:
            yield node


@cache
def _sort(cls, sought):
    """How a class of nodes is searched: this is asked for every node of every constraint."""
    if cls in sought:
        return _SOUGHT
    if issubclass(cls, NamedExpressionData):
        return _NAMED
    return _OPERATION if issubclass(cls, ExpressionBase) else _LEAF
