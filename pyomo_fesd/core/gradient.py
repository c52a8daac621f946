"""Numeric gradients of expressions: by Pyomo, or by casadi for the functions that Pyomo does not differentiate (tanh, abs at 0)."""

import casadi as ca
import numpy as np
from pyomo.core import value
from pyomo.core.expr import numeric_expr as nodes
from pyomo.core.expr import relational_expr as relations
from pyomo.core.expr.calculus.derivatives import Modes, differentiate
from pyomo.core.expr.calculus.diff_with_pyomo import DifferentiationException
from pyomo.core.expr.visitor import StreamBasedExpressionVisitor

#: Nodes whose own operation does not take symbols.
OPERATIONS = {
    nodes.AbsExpression: lambda node, args: ca.fabs(*args),
    nodes.UnaryFunctionExpression: lambda node, args: getattr(ca, node.name)(*args),
    nodes.Expr_ifExpression: lambda node, args: ca.if_else(*args),
    relations.InequalityExpression: lambda node, args: args[0] <= args[1],
    relations.RangedExpression: lambda node, args: ca.logic_and(args[0] <= args[1], args[1] <= args[2]),
}


def gradient(expression, variables) -> list[float]:
    """Return the derivatives of an expression with respect to ``variables`` at their present values, fixed or not.

    They are NaN where they depend on a variable without a value.

    Raises
    ------
    NotImplementedError
        for an operation that neither of them differentiates
    """
    if any(v.value is None for v in variables):
        return _by_casadi(expression, variables)
    try:
        return differentiate(expression, wrt_list=variables, mode=Modes.reverse_numeric)
    except (DifferentiationException, ArithmeticError, ValueError):
        return _by_casadi(expression, variables)


def _by_casadi(expression, variables):
    now = [np.nan if v.value is None else float(v.value) for v in variables]
    return slopes_by_casadi(expression, variables)(now).full().ravel().tolist()


def slopes_by_casadi(expression, variables) -> ca.Function:
    """Return the gradient of an expression as a function of the values of ``variables``; the numbers in it are those of now.

    Raises
    ------
    NotImplementedError
        for an operation that casadi does not have
    """
    symbols = ca.SX.sym('x', len(variables))
    at = {id(v): symbols[k] for k, v in enumerate(variables)}
    slopes = ca.gradient(ca.SX(_symbolic(expression, at)), symbols)
    return ca.Function('slopes', [symbols], [ca.densify(slopes)])


def _symbolic(expression, at):
    def before(node, child, index):
        if id(child) in at:
            return False, at[id(child)]
        is_expression = hasattr(child, 'is_expression_type') and child.is_expression_type()
        return is_expression, None if is_expression else value(child)

    def leave(node, args):
        operation = next((OPERATIONS[kind] for kind in node.__class__.__mro__ if kind in OPERATIONS), None)
        try:
            return node._apply_operation(args) if operation is None else operation(node, args)
        except (TypeError, AttributeError) as error:
            raise NotImplementedError(f"casadi has no '{node}'") from error

    visitor = StreamBasedExpressionVisitor(beforeChild=before, exitNode=leave)
    visitor.initializeWalker = lambda expr: _begin(before, expr)
    return visitor.walk_expression(expression)


def _begin(before, expression):
    enters, found = before(None, expression, 0)
    return (True, expression) if enters else (False, found)
