"""The shape of expressions: all of them but the variables.

A Disjunction has the same shape at every time, and so has another one that the same rule wrote.  What is found of one of them is
true of the others, with their variables in the places of the first one's; so each shape is read once.
"""

from pyomo.common.numeric_types import native_types
from pyomo.core import value
from pyomo.core.expr import numeric_expr as nodes
from pyomo.core.expr import relational_expr as relations
from pyomo.core.expr.visitor import ExpressionReplacementVisitor

#: Nodes that their class, the number of their arguments and sometimes a detail say everything of.
DETAILS = dict.fromkeys(
    (
        nodes.SumExpression,
        nodes.LinearExpression,
        nodes.ProductExpression,
        nodes.MonomialTermExpression,
        nodes.DivisionExpression,
        nodes.PowExpression,
        nodes.NegationExpression,
        nodes.AbsExpression,
        nodes.NPV_SumExpression,
        nodes.NPV_ProductExpression,
        nodes.NPV_DivisionExpression,
        nodes.NPV_PowExpression,
        nodes.NPV_NegationExpression,
        nodes.NPV_AbsExpression,
        relations.EqualityExpression,
    )
) | {
    nodes.UnaryFunctionExpression: nodes.UnaryFunctionExpression.getname,
    nodes.NPV_UnaryFunctionExpression: nodes.UnaryFunctionExpression.getname,
    relations.InequalityExpression: lambda node: node.strict,
    relations.RangedExpression: lambda node: node.strict,
}


def shape(expressions, kind):
    """Shape of some expressions together, None where one has a node that is not in ``DETAILS``; and their parts.

    Parameters
    ----------
    kind : callable VarData -> hashable
        what matters of a variable besides its place; of a Param it is its value

    Returns
    -------
    hashable or None
    list of variables, Params and named Expressions, each once
    """
    seen, places, parts, kinds, number = [], [], [], [], {}
    waiting = list(expressions)
    while waiting:
        node = waiting.pop()
        among = node.__class__
        if among in native_types:
            seen.append(node)
        elif among in DETAILS:
            detail, arguments = DETAILS[among], node.args
            seen.append((among, len(arguments), detail and detail(node)))
            waiting.extend(arguments)
        elif node.is_expression_type() and not node.is_named_expression_type():
            return None, []
        else:
            seen.append(None)
            if id(node) not in number:
                number[id(node)] = len(parts)
                parts.append(node)
                if node.is_expression_type():
                    kinds.append(None)
                    waiting.append(node.expr)
                else:
                    kinds.append(kind(node) if node.is_variable_type() else value(node, exception=False))
            places.append(number[id(node)])
    return (tuple(seen), tuple(places), tuple(kinds)), parts


class Swap:
    """Puts the parts of one thing in the places of those of another of the same shape."""

    #: To make one takes Pyomo longer than to use it.
    _VISITOR = ExpressionReplacementVisitor()

    def __init__(self, parts, others):
        self._other = {id(part): other for part, other in zip(parts, others)}

    def __getitem__(self, part):
        return self._other[id(part)]

    def expression(self, expr):
        """``expr`` with the parts of the other."""
        self._VISITOR.substitute = self._other
        return self._VISITOR.walk_expression(expr)
