"""Build an expression again with other components, for many that are built alike: its tree is read once.

Takes: the components of an expression, in the order of its ``expression_key``.
Leaves: expressions of other components with the same key, so that each node keeps its class; named Expressions are written out.
Does not apply: to components of another type, such as a number for a variable; ``exchanged`` chooses the classes of nodes anew.
"""

from collections.abc import Callable, Sequence
from functools import partial
from operator import itemgetter

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
        self._places, self._number = {id(part): k for k, part in enumerate(parts)}, len(parts)
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
        # constants, which contain no part, have negative places, until their number is known
        places, constants, steps = dict(self._places), [], []
        for node, arguments in _in_order(expressions, places):
            where = [places[id(argument)] for argument in arguments]
            if arguments and node.is_named_expression_type():
                places[id(node)] = where[0]
            elif all(place < 0 for place in where):
                places[id(node)] = ~len(constants)
                constants.append(node)
            else:
                places[id(node)] = self._number + len(steps)
                steps.append((_maker(node), where))

        def among_values(nodes_at):
            return [~place if place < 0 else place + len(constants) for place in nodes_at]

        steps = [(make, _getter(among_values(where))) for make, where in steps]
        roots = among_values(places[id(expr)] for expr in expressions)

        def build(others):
            values = [*constants, *others]
            for make, arguments in steps:
                values.append(make(arguments(values)))
            return [values[root] for root in roots]

        return build


def _in_order(expressions, known):
    """Yield each node that is not ``known``, after those in it, with its arguments."""
    met, waiting = set(known), list(expressions)[::-1]
    while waiting:
        node = waiting[-1]
        arguments = node.args if node.__class__ not in native_types and node.is_expression_type() else ()
        missing = [] if id(node) in met else [a for a in arguments if id(a) not in met]
        if missing:
            waiting.extend(missing)
            continue
        waiting.pop()
        if id(node) not in met:
            met.add(id(node))
            yield node, arguments


def _getter(places):
    """The function from values to those at some ``places``, in a sequence."""
    return itemgetter(*places) if len(places) > 1 else itemgetter(slice(places[0], places[0] + 1))


def _maker(node):
    """The function from arguments to a node like this one."""
    cls = node.__class__
    if cls is relations.InequalityExpression:
        return partial(cls, strict=node.strict)
    if isinstance(node, nodes.SumExpression):
        # terms can be added to it
        return lambda arguments: cls(list(arguments))
    return cls if cls in MADE_FROM_ARGUMENTS else node.create_node_with_local_data
