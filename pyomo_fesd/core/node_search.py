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
    sorts, waiting = _sorts(sought), [(expr,)]
    while waiting:
        for node in waiting.pop():
            sort = sorts[node.__class__]
            if sort is _LEAF:
                continue
            if sort is _SOUGHT or (sort is _NAMED and enter is None):
                return True
            if sort is _OPERATION or enter(node):
                waiting.append(node.args)
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


class _Sorts(dict):
    """How each class of nodes is searched: this is looked up for every node of every constraint."""

    def __init__(self, sought):
        super().__init__(dict.fromkeys(sought, _SOUGHT))

    def __missing__(self, cls):
        sort = _NAMED if issubclass(cls, NamedExpressionData) else _OPERATION if issubclass(cls, ExpressionBase) else _LEAF
        self[cls] = sort
        return sort


_sorts = cache(_Sorts)
