"""Errors for expressions that cannot be compiled, with the component that contains them."""

import logging

import numpy as np
from pyomo.core import Block, Constraint, Objective, Param, Var, value
from pyomo.core.expr import (
    Expr_ifExpression,
    ExternalFunctionExpression,
    InequalityExpression,
    RangedExpression,
    UnaryFunctionExpression,
)
from pyomo.mpec import Complementarity

from pyomo_fesd.core import FesdError

#: Nodes, and names of unary functions, that are not compiled.
UNSUPPORTED_NODES = (ExternalFunctionExpression, Expr_ifExpression)
UNSUPPORTED_FUNCTIONS = ('asinh', 'acosh', 'atanh')
#: What Pyomo logs where it leaves out a term.
UNDEFINED = 'Exception encountered evaluating expression'


def refuse_dropped_terms(model, messages) -> None:
    """Refuse what Pyomo could not evaluate, as it leaves out such terms or whole rows; show other messages."""
    for record in messages:
        if UNDEFINED in record.getMessage():
            raise without_value(model, record.getMessage().split('message:')[-1])
        logging.getLogger(record.name).handle(record)


def without_value(model, text) -> FesdError:
    """Return the error of an expression without a value, from Pyomo's message.

    Raises
    ------
    FesdError
        if the cause is a fixed variable or Param whose value is no number
    """
    _refuse_invalid(model)
    text = ' '.join(text.split())
    term = text.split('expression:')[-1].strip()
    stated = model.component_data_objects((Constraint, Objective, Complementarity), active=True, descend_into=Block)
    found = next((c for c in stated if 'expression:' in text and any(term in str(e) for e in _expressions(c))), model)
    return FesdError(found, f"an expression of fixed values has no value: {text}", "change these values")


def unsupported(model, symbols) -> FesdError:
    """Return the error that names the component with a function that is not compiled; ``symbols`` are those of parameters."""
    _refuse_invalid(model)
    for component in model.component_data_objects(active=True, descend_into=Block):
        found = [node for node in _nodes(component) if _is_unsupported(node)]
        if found:
            # the worst first: others may be accepted
            return FesdError(symbols.original(component), *min(map(_cause_and_fix, found), key=_is_of_conditional))
    return FesdError(model, "it contains a function that cannot be evaluated", "report this model")


def _is_of_conditional(cause_and_fix):
    return "'Expr_if'" in cause_and_fix[0]


def _cause_and_fix(node):
    if isinstance(node, Expr_ifExpression) and not isinstance(node.arg(0), (InequalityExpression, RangedExpression)):
        return "an if-then-else whose condition is no inequality", "write the condition as an inequality"
    return f"the function '{node.getname()}' cannot be evaluated here", _fix(node)


def _fix(node):
    if isinstance(node, ExternalFunctionExpression):
        return (
            "casadi cannot call functions of a compiled library: take a property package whose equations are written out (as the "
            "modular ones with an ideal equation of state), or solve this model with Ipopt's executable"
        )
    return "write it with exp, log, sqrt or a complementarity (for if-then-else: a Disjunction)"


def _refuse_invalid(model):
    """Raise for a fixed variable or a mutable Param that is NaN or infinite; one may be infinite where it is only a bound."""
    fixed = (v for v in model.component_data_objects(Var, descend_into=Block) if v.fixed)
    changing = (p for param in model.component_objects(Param, descend_into=Block) if param.mutable for p in param.values())
    for data in (*fixed, *changing):
        now = value(data, exception=False)
        if isinstance(now, (float, np.floating)) and not np.isfinite(now):
            raise FesdError(data, f"its value is {now}", "give it a number")


def _is_unsupported(node):
    if isinstance(node, UnaryFunctionExpression):
        return node.getname() in UNSUPPORTED_FUNCTIONS
    return isinstance(node, UNSUPPORTED_NODES)


def _expressions(component):
    """The expressions of a component."""
    return component._args or () if component.ctype is Complementarity else (getattr(component, 'expr', None),)


def _nodes(component):
    """Every operation in the expressions of a component."""
    stack = list(_expressions(component))
    while stack:
        node = stack.pop()
        if hasattr(node, 'is_expression_type') and node.is_expression_type():
            yield node
            stack.extend(node.args)
