"""Pyomo's NL file of a model, and what casadi reads from it."""

import os
import tempfile
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass

import casadi as ca
import numpy as np
from pyomo.core import Block, Suffix
from pyomo.core.expr import Expr_ifExpression, ExternalFunctionExpression, UnaryFunctionExpression
from pyomo.repn.plugins.nl_writer import NLWriter

from pyomo_fesd.errors import FesdError

#: What casadi's NL reader cannot evaluate: nodes, and the names of unary functions.
UNSUPPORTED_NODES = (ExternalFunctionExpression, Expr_ifExpression)
UNSUPPORTED_FUNCTIONS = ('asinh', 'acosh', 'atanh')


@dataclass(frozen=True)
class Nl:
    """A model as casadi knows it.

    Attributes
    ----------
    variables : list of VarData (n);  constraints : list of ConstraintData (m), in the order of the file
    function : casadi Function (x) -> f, g, on SX
    lbg, ubg : arrays (m)
        constants of linear rows stand in their bounds
    """

    variables: list
    constraints: list
    function: object
    lbg: np.ndarray
    ubg: np.ndarray


def folder_for(folder):
    """Context with the folder to write to: ``folder``, or a temporary one."""
    return nullcontext(folder) if folder else tempfile.TemporaryDirectory()


def write(model, folder):
    """Write ``folder``/model.nl; returns its path, and the writer's variables and constraints in their order.

    Raises
    ------
    InfeasibleConstraintException
        where fixed values alone violate a constraint
    """
    path = os.path.join(folder, 'model.nl')
    with open(path, 'w', newline='') as stream, _suffixes_asleep(model):
        info = NLWriter().write(model, stream, linear_presolve=False, scale_model=False, symbolic_solver_labels=False)
    return path, info.variables, info.constraints


@contextmanager
def _suffixes_asleep(model):
    """Without the suffixes that the NL writer would export; casadi cannot read them."""
    suffixes = [s for s in model.component_objects(Suffix, active=True, descend_into=Block) if s.export_enabled()]
    for suffix in suffixes:
        suffix.deactivate()
    try:
        yield
    finally:
        for suffix in suffixes:
            suffix.activate()


def read(model, handles, path, variables, constraints):
    """Read what ``write`` has written, with ``handles`` for the parameters.

    Raises
    ------
    FesdError
        naming the component with a function that cannot be evaluated
    """
    nl = ca.NlpBuilder()
    try:
        nl.import_nl(path)
    except RuntimeError as error:
        raise _unsupported(model, handles, error) from None
    function = ca.Function('nl', [ca.vertcat(*nl.x)], [nl.f, ca.vertcat(*nl.g)]).expand()
    return Nl(variables, constraints, function, np.array(nl.g_lb, dtype=float), np.array(nl.g_ub, dtype=float))


def _unsupported(model, handles, error):
    """Name the component whose expression casadi could not read."""
    for component in model.component_data_objects(descend_into=Block, active=True):
        for node in _nodes(getattr(component, 'expr', None)):
            if _is_unsupported(node):
                return FesdError(
                    handles.source(component),
                    f"the function '{node.getname()}' cannot be evaluated here",
                    "write it with exp, log, sqrt or a complementarity (for if-then-else: a Disjunction)",
                )
    return FesdError(model, f"casadi cannot read the model: {str(error).splitlines()[-1]}", "report this model")


def _is_unsupported(node):
    if isinstance(node, UnaryFunctionExpression):
        return node.getname() in UNSUPPORTED_FUNCTIONS
    return isinstance(node, UNSUPPORTED_NODES)


def _nodes(expr):
    """Every operation in ``expr``, which may be no expression at all."""
    stack = [expr]
    while stack:
        node = stack.pop()
        if hasattr(node, 'is_expression_type') and node.is_expression_type():
            yield node
            stack.extend(node.args)
