"""Find the absolute values in one expression, and replace them.

Both walks decide alike: a pattern that is replaced is entered at its z alone, any other pattern as an ordinary expression.  So the
inner pattern of a replaced one does not count as inside a root.

Pyomo takes several times longer to make a walker than to walk a constraint, so each walker is made once for all expressions.
"""

from pyomo.common.numeric_types import native_types
from pyomo.core.expr import numeric_expr as ne
from pyomo.core.expr.visitor import StreamBasedExpressionVisitor

from pyomo_fesd.core import contains_node
from pyomo_fesd.smoothing.linear_terms import LinearCombination
from pyomo_fesd.smoothing.patterns import RULES, guards, match

#: Classes of nodes that may be a pattern.
PATTERN_NODES = frozenset(RULES)
#: Types that are not entered; ``Expr_if`` jumps, and its condition is not a number.
CLOSED = {*native_types, ne.Expr_ifExpression}


def may_match(expressions) -> bool:
    """Whether any of some expressions or relations contains a node that may be a pattern, or a named Expression."""
    return any(contains_node(e, PATTERN_NODES) for e in expressions)


def _expression(result):
    return result.expression() if isinstance(result, LinearCombination) else result


class _Walker(StreamBasedExpressionVisitor):
    """Track at each node whether it is inside a guarded argument, and enter replaced patterns at their z."""

    def __init__(self):
        super().__init__()
        self._begin(None)

    def _begin(self, replaced):
        """Prepare for another expression; ``replaced`` is a function (Match, guarded) -> bool."""
        self._replaced = replaced
        self._entered = []  # for each node above the present one: its Match if it is replaced
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


class PatternReader(_Walker):
    """Collects all patterns and named Expressions of one expression after the other."""

    def read(self, expr, replaced) -> tuple:
        """Return the patterns of ``expr`` and the named Expressions in it.

        Parameters
        ----------
        replaced : function (Match, guarded) -> bool

        Returns
        -------
        list of (Match, guarded), list of (ExpressionData, guarded)
            in the order of the expression; ``guarded``: inside an argument that is kept away from 0
        """
        self._begin(replaced)
        self._matches, self._named = [], []
        if may_match((expr,)):
            self.walk_expression(expr)
        return self._matches, self._named

    def _takes(self, found):
        self._matches.append((found, self._guards > 0))
        return super()._takes(found)

    def _meet(self, named):
        self._named.append((named, self._guards > 0))


class PatternReplacer(_Walker):
    """Replaces patterns: each node stays where nothing below it was replaced, and becomes a LinearCombination elsewhere."""

    def replace(self, expr, replaced, absolute):
        """Return ``expr`` with ``absolute(z)`` for the patterns that ``replaced`` holds for; both are LinearCombinations."""
        self._begin(replaced)
        self._absolute = absolute
        return _expression(self.walk_expression(expr))

    def _leave(self, node, results, found):
        if found is not None:
            return self._absolute(LinearCombination(results[0]))
        if not any(isinstance(r, LinearCombination) for r in results):
            return node
        return LinearCombination(node.create_node_with_local_data(list(map(_expression, results))))
