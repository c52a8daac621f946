"""Structure of expressions: equal keys mean that the expressions differ in their variables only.

One compiled function serves all elements whose equations have the same key.

Does not apply: to expressions that are equal by algebra only; their keys differ.
"""

from collections.abc import Iterable

from pyomo.common.collections import ComponentSet
from pyomo.common.numeric_types import native_numeric_types, native_types
from pyomo.core import value

from pyomo_fesd.core.expression_key import detail_of
from pyomo_fesd.core.node_search import leaves_of


def variables_of(expressions: Iterable) -> ComponentSet:
    """Return all variables of ``expressions``, fixed ones too, each once."""
    found = ComponentSet()
    for e in expressions:
        if hasattr(e, 'is_expression_type'):
            found.update(leaf for leaf in leaves_of(e) if leaf.is_variable_type())
    return found


def nine_digits(number):
    """A number as text, rounded as labels of time are; strings and None stay."""
    return '%.9g' % number if number.__class__ in native_numeric_types else number


def any_number(_):
    """The same token for all numbers."""
    return ''


def exactly(number):
    """The number itself, in a tuple: positions of variables are numbers too."""
    return (number,)


class StructuralKey:
    """Key of a sequence of expressions.

    Attributes
    ----------
    tokens : list
        equal for equal structure, positions of variables and numbers
    variables : list of VarData
        in the order of their first occurrence, fixed ones too
    """

    def __init__(self):
        self.tokens, self.variables, self._positions = [], [], {}

    def append(self, expr, number=nine_digits) -> None:
        """Append the tokens of ``expr``; ``number`` is a function from a number to its token."""
        self.extend([expr], number)

    def extend(self, expressions: Iterable, number=nine_digits) -> None:
        """Append the tokens of some expressions, in prefix notation."""
        # a reader of equations spends most of its time here
        tokens, variables, positions, waiting = self.tokens, self.variables, self._positions, list(expressions)[::-1]
        while waiting:
            node = waiting.pop()
            kind = node.__class__
            if kind in native_types:
                tokens.append(number(node))
                continue
            detail = detail_of(kind)
            if detail is not None:
                arguments = node.args
                tokens.append((kind, len(arguments), detail(node)))
                waiting.extend(arguments[::-1])
            elif id(node) in positions:
                tokens.append(positions[id(node)])
            elif node.is_variable_type():
                tokens.append(positions.setdefault(id(node), len(variables)))
                variables.append(node)
            elif node.is_named_expression_type():
                tokens.append(None)
                waiting.append(node.expr)
            elif node.is_expression_type():
                tokens.append((kind, getattr(node, '_name', None), node.nargs()))
                waiting.extend(node.args[::-1])
            else:
                tokens.append(number(value(node, exception=False)))
