"""Pyomo's expressions as casadi expressions (SX) of symbols for their variables.

Takes: expressions.
Leaves: nothing.
Does not apply: to functions that casadi does not have, if-then-else, and numbers that are not finite.
"""

from functools import cache, partial, reduce
from math import isfinite

import casadi as ca
from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import value
from pyomo.core.base.var import VarData
from pyomo.core.expr import numeric_expr as nodes


def _binary(code):
    # casadi's methods take a sixth of the time of Python's operators, which try to convert their arguments first
    return lambda node, args: ca.SX.binary(code, *args)


def difference(a: ca.SX, b: ca.SX) -> ca.SX:
    """Return a - b."""
    return ca.SX.binary(ca.OP_SUB, a, b)


def _sum(node, args):
    return reduce(partial(ca.SX.binary, ca.OP_ADD), args)


def _function(node, args):
    if node.name not in FUNCTIONS:
        raise Unsupported(node.name)
    return FUNCTIONS[node.name](*args)


#: Functions by the names that Pyomo gives them.
NAMES = 'ceil', 'floor', 'exp', 'log', 'log10', 'sqrt', 'sin', 'cos', 'tan', 'asin', 'acos', 'atan', 'sinh', 'cosh', 'tanh'
FUNCTIONS = {name: getattr(ca, name) for name in NAMES}
#: Operations; subclasses are like them, the first one counts.
OPERATIONS = {
    nodes.AbsExpression: lambda node, args: ca.fabs(*args),
    nodes.UnaryFunctionExpression: _function,
    nodes.SumExpression: _sum,
    nodes.ProductExpression: _binary(ca.OP_MUL),
    nodes.DivisionExpression: _binary(ca.OP_DIV),
    nodes.PowExpression: _binary(ca.OP_POW),
    nodes.NegationExpression: lambda node, args: ca.SX.unary(ca.OP_NEG, *args),
}


class Unsupported(Exception):
    """A function or a number that cannot be evaluated."""


class CasadiExpressions:
    """Writes expressions with ``symbols`` (by the id of a variable)."""

    def __init__(self, symbols: dict):
        self._symbols, self._numbers = symbols, {}

    def of(self, expr, met: dict) -> ca.SX:
        """Return ``expr`` with symbols; ``met`` receives its variables by their ids.

        Raises
        ------
        Unsupported
        """
        stack = []
        for token in reversed(self._prefix(expr, met)):
            if token.__class__ is tuple:
                operation, node, count = token
                arguments = stack[-count:]
                del stack[-count:]
                token = operation(node, arguments)
            stack.append(token)
        return stack.pop()

    def _prefix(self, expr, met):
        """Operations before their arguments, the last of these first."""
        tokens, waiting, symbols = [], [expr], self._symbols
        while waiting:
            node = waiting.pop()
            kind = node.__class__
            if kind is VarData:
                met[id(node)] = node
                tokens.append(symbols[id(node)])
            elif kind in native_numeric_types or node is None:
                tokens.append(self._number(node))
            elif (operation := _operation(kind)) is not None:
                arguments = node.args
                tokens.append((operation, node, len(arguments)))
                waiting.extend(arguments)
            elif node.is_variable_type():
                met[id(node)] = node
                tokens.append(symbols[id(node)])
            elif not node.is_expression_type():
                tokens.append(self._number(value(node, exception=False)))
            elif node.is_named_expression_type():
                waiting.append(node.expr)
            else:
                raise Unsupported(kind)
        return tokens

    def _number(self, number):
        # casadi takes longer to make a number than to add two
        found = self._numbers.get(number)
        if found is None:
            if number is None or isinstance(number, complex) or not isfinite(number):
                raise Unsupported(number)
            found = self._numbers[number] = ca.SX(float(number))
        return found


@cache
def _operation(kind):
    """How nodes of a class are written; None where ``OPERATIONS`` does not say."""
    return next((operation for known, operation in OPERATIONS.items() if issubclass(kind, known)), None)
