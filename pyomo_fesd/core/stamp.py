"""Build an expression again with other components, for many that are built alike: its tree is read once.

Takes: the components of an expression, in the order of its ``expression_key``.
Leaves: expressions of other components with the same key, so that each node keeps its class; named Expressions are written out.
Does not apply: to components of another type, such as a number for a variable; ``exchanged`` chooses the classes of nodes anew.
"""

from collections.abc import Callable, Sequence
from functools import partial

from pyomo.common.numeric_types import native_types
from pyomo.core.expr import numeric_expr as nodes
from pyomo.core.expr import relational_expr as relations

#: Nodes that are made from their arguments alone; others hold more, such as the name of a function.
MADE_FROM_ARGUMENTS = frozenset(
    [nodes.SumExpression, nodes.LinearExpression, nodes.MonomialTermExpression, nodes.ProductExpression, nodes.DivisionExpression]
    + [nodes.PowExpression, nodes.NegationExpression, relations.EqualityExpression]
)


class Stamp:
    """Expressions of some components, to be built again with others.

    Parameters
    ----------
    parts : sequence of components
    """

    def __init__(self, parts: Sequence):
        self._places = {id(part): k for k, part in enumerate(parts)}
        self._builders = {}

    def place(self, part) -> int:
        """Return the position of a component."""
        return self._places[id(part)]

    def expression(self, expr, others: Sequence):
        """Return ``expr`` with ``others`` in place of the parts."""
        # the expression is kept, so that no other one gets its id
        found = self._builders.get(id(expr))
        if found is None:
            found = self._builders[id(expr)] = expr, self.builder([expr])
        return found[1](others)[0]

    def builder(self, expressions: Sequence) -> Callable:
        """Return the function from ``others`` to all ``expressions`` with them; nodes that these share are shared again."""
        places = dict(self._places)
        steps = _steps(expressions, places)
        roots = [places[id(expr)] for expr in expressions]

        def build(others):
            values = list(others)
            for make, arguments in steps:
                values.append(arguments if make is None else make([values[k] for k in arguments]))
            return [values[root] for root in roots]

        return build


def _steps(expressions, places):
    """``(function, places of its arguments)`` of each node, after those of its arguments; ``(None, value)`` of constant ones."""
    steps, parts, constant, waiting = [], len(places), set(), list(expressions)[::-1]
    while waiting:
        node = waiting[-1]
        arguments = node.args if node.__class__ not in native_types and node.is_expression_type() else ()
        missing = [a for a in arguments if id(a) not in places]
        if id(node) not in places and missing:
            waiting.extend(missing)
            continue
        waiting.pop()
        if id(node) in places:
            continue
        if arguments and node.is_named_expression_type():
            places[id(node)] = places[id(arguments[0])]
            continue
        where = [places[id(a)] for a in arguments]
        places[id(node)] = parts + len(steps)
        if constant.issuperset(where):
            constant.add(places[id(node)])
            steps.append((None, node))
        else:
            steps.append((_maker(node), where))
    return steps


def _maker(node):
    if node.__class__ is relations.InequalityExpression:
        return partial(relations.InequalityExpression, strict=node.strict)
    return node.__class__ if node.__class__ in MADE_FROM_ARGUMENTS else node.create_node_with_local_data
