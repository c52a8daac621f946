"""Structure of expressions: equal keys mean that the expressions differ in their variables only.

One compiled function serves all elements whose equations have the same key.

Does not apply: to expressions that are equal by algebra only; their keys differ.
"""

from collections.abc import Iterable

from pyomo.common.collections import ComponentSet
from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import value
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core.expression_key import prefix_tokens


def variables_of(expressions: Iterable) -> ComponentSet:
    """Return all variables of ``expressions``, fixed ones too, each once."""
    found = ComponentSet()
    for e in expressions:
        if hasattr(e, 'is_expression_type'):
            found.update(identify_variables(e, include_fixed=True))
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

        def leaf(node):
            if node.is_variable_type():
                return self._position(node), ()
            if node.is_named_expression_type():
                return None, (node.expr,)
            if node.is_expression_type():
                return (node.__class__, getattr(node, '_name', None), node.nargs()), node.args
            return number(value(node, exception=False)), ()

        self.tokens += prefix_tokens([expr], leaf, number)

    def _position(self, v):
        if id(v) not in self._positions:
            self._positions[id(v)] = len(self.variables)
            self.variables.append(v)
        return self._positions[id(v)]
