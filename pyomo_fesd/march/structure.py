"""What expressions look like: their structure and numbers, and the variables in the order in which they occur.

Expressions of two elements that look the same differ in their variables only, so one compiled function serves both.

Takes: expressions; nothing is evaluated but what contains no variable.
Leaves: nothing.
Does not apply: to expressions that are equal by algebra only; they count as different.
"""

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import value
from pyomo.core.expr.numeric_expr import NumericExpression
from pyomo.core.expr.relational_expr import RelationalExpression

NUMBER, VARIABLE, NAMED, OPERATION, PARAMETER = range(5)
#: class -> what it is
_SORTS = {}


class Look:
    """Looks at one expression after the other.

    Attributes
    ----------
    tokens : list
        equal for equal structure, position of variables and numbers
    variables : list of VarData
        each once, fixed ones too
    """

    def __init__(self):
        self.tokens, self.variables, self._places = [], [], {}

    def at(self, expr, numbers=True):
        """Look at ``expr``; without ``numbers`` all numbers count as equal."""
        tokens, places, stack = self.tokens, self._places, [expr]
        while stack:
            node = stack.pop()
            sort = _SORTS.get(node.__class__)
            if sort is None:
                sort = _SORTS[node.__class__] = _sort(node)
            if sort == OPERATION:
                args = node.args
                tokens.append((node.__class__, getattr(node, '_name', None), len(args)))
                stack.extend(args[::-1])
            elif sort == VARIABLE:
                place = places.get(id(node))
                if place is None:
                    place = places[id(node)] = len(self.variables)
                    self.variables.append(node)
                tokens.append(place)
            elif sort == NAMED:
                stack.append(node.expr)
            else:
                tokens.append(_number(node) if numbers else '')


def _sort(node):
    if node.__class__ in native_numeric_types:
        return NUMBER
    if not hasattr(node, 'is_expression_type'):
        return PARAMETER
    if node.is_variable_type():
        return VARIABLE
    if not node.is_expression_type():
        return PARAMETER
    # a named expression, or what else stands for another one
    return OPERATION if isinstance(node, (NumericExpression, RelationalExpression)) else NAMED


def _number(node):
    """Nine digits; labels of time are rounded."""
    found = value(node, exception=False) if node is not None else None
    return None if found is None else '%.9g' % found
