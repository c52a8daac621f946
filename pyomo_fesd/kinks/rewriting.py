"""One expression: what absolute values it contains, and the same expression with others in their place.

Both walks decide alike: a pattern that is replaced is entered by its z alone, any other one as the expression that it is.  So
the inner pattern of a replaced one does not count as standing inside a root.
"""

from pyomo.common.numeric_types import native_types
from pyomo.core.expr import numeric_expr as ne
from pyomo.core.expr.visitor import StreamBasedExpressionVisitor

from pyomo_fesd.kinks.patterns import guards, match
from pyomo_fesd.kinks.terms import Terms

#: Types that are not entered; ``Expr_if`` jumps, and its condition is no number.
CLOSED = {*native_types, ne.Expr_ifExpression}


def read(expr, replaced):
    """The patterns of ``expr`` and the named Expressions in it.

    Parameters
    ----------
    replaced : function (Match, guarded) -> bool

    Returns
    -------
    list of (Match, guarded), list of (ExpressionData, guarded)
        in the order of the expression; ``guarded``: inside an argument that is kept away from 0
    """
    walker = _Reader(replaced)
    walker.walk_expression(expr)
    return walker.matches, walker.named


def rewrite(expr, replaced, absolute):
    """``expr`` with ``absolute(Terms of z)``, which returns Terms, in the place of the patterns that are ``replaced``."""
    result = _Rewriter(replaced, absolute).walk_expression(expr)
    return result.expression() if isinstance(result, Terms) else result


class _Walker(StreamBasedExpressionVisitor):
    """Knows at each node whether it stands inside a guarded argument, and enters replaced patterns by their z."""

    def __init__(self, replaced):
        super().__init__()
        self._replaced = replaced
        self._entered = []  # for each node on the way down: its Match if it is replaced
        self._guards = 0

    def initializeWalker(self, expr):
        return self.beforeChild(None, expr, 0)

    def enterNode(self, node):
        found = match(node)
        if found is not None and not self._takes(found):
            found = None
        self._entered.append(found)
        return (None if found is None else (found.z,)), []

    def _takes(self, found):
        return self._replaced(found, self._guards > 0)

    def _guarding(self, node, position):
        return node is not None and self._entered[-1] is None and guards(node, position)

    def beforeChild(self, node, child, position):
        if self._guarding(node, position):
            self._guards += 1
        if child.__class__ in CLOSED or not child.is_expression_type() or not child.is_potentially_variable():
            return False, child
        if child.is_named_expression_type():
            self._meet(child)
            return False, child
        return True, None

    def _meet(self, named):
        """Called for each named Expression; it is not entered."""

    def afterChild(self, node, child, position):
        if self._guarding(node, position):
            self._guards -= 1

    def exitNode(self, node, results):
        return self._leave(node, results, self._entered.pop())

    def _leave(self, node, results, found):
        return node


class _Reader(_Walker):
    def __init__(self, replaced):
        super().__init__(replaced)
        self.matches, self.named = [], []

    def _takes(self, found):
        self.matches.append((found, self._guards > 0))
        return super()._takes(found)

    def _meet(self, named):
        self.named.append((named, self._guards > 0))


class _Rewriter(_Walker):
    """Gives back each node itself where nothing below it was replaced, Terms elsewhere."""

    def __init__(self, replaced, absolute):
        super().__init__(replaced)
        self._absolute = absolute

    def _leave(self, node, results, found):
        if found is not None:
            return self._absolute(Terms(results[0]))
        if not any(isinstance(r, Terms) for r in results):
            return node
        args = [r.expression() if isinstance(r, Terms) else r for r in results]
        return Terms(node.create_node_with_local_data(args))
