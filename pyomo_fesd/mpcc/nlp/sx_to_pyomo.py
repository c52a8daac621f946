"""A casadi SX graph as a Pyomo model; shared sub-expressions become named Expressions, which an NL file shares as well."""

import operator

import casadi as ca
import numpy as np
import pyomo.environ as pyo

from pyomo_fesd.core import FesdError
from pyomo_fesd.mpcc.nlp.solver import rows_with_variables

#: Functions of the same name in casadi and Pyomo.
FUNCTIONS = ('exp', 'log', 'sqrt', 'sin', 'cos', 'tan', 'asin', 'acos', 'atan', 'sinh', 'cosh', 'tanh', 'asinh', 'acosh', 'atanh')
#: casadi's operations as Pyomo's.
OPERATIONS = {getattr(ca, f'OP_{name.upper()}'): getattr(pyo, name) for name in (*FUNCTIONS, 'floor', 'ceil')} | {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: operator.add,
    ca.OP_SUB: operator.sub,
    ca.OP_MUL: operator.mul,
    ca.OP_DIV: operator.truediv,
    ca.OP_NEG: operator.neg,
    ca.OP_POW: operator.pow,
    ca.OP_CONSTPOW: operator.pow,
    ca.OP_SQ: lambda a: a**2,
    ca.OP_TWICE: lambda a: 2 * a,
    ca.OP_INV: lambda a: 1 / a,
    ca.OP_FABS: abs,
    ca.OP_EXPM1: lambda a: pyo.exp(a) - 1,
    ca.OP_LOG1P: lambda a: pyo.log(1 + a),
}


def sx_to_pyomo(x: ca.SX, p: ca.SX, f: ca.SX, g: ca.SX) -> pyo.ConcreteModel:
    """The graph as a model: variables ``x``, parameters ``p``, objective ``f``, rows ``g`` between ``lower`` and ``upper``."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(x.numel()))
    m.p = pyo.Param(range(p.numel()), mutable=True, initialize=0.0)
    m.shared = pyo.Expression(pyo.NonNegativeIntegers)
    (objective,), rows = _pyomo_expressions(
        ca.Function('nlp', [x, p], [f, ca.densify(g)]), [list(m.x.values()), list(m.p.values())], m
    )
    m.lower = pyo.Param(range(len(rows)), mutable=True, initialize=-np.inf)
    m.upper = pyo.Param(range(len(rows)), mutable=True, initialize=np.inf)
    m.f = pyo.Objective(expr=objective)
    m.g = pyo.Constraint(np.flatnonzero(rows_with_variables(g, x)).tolist(), rule=lambda m, i: (m.lower[i], rows[i], m.upper[i]))
    m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    return m


def _pyomo_expressions(function, inputs, m):
    """The outputs of an SX function as expressions of its ``inputs``; values that are used more than once go to ``m.shared``."""
    uses = _uses(function)
    outputs = [[0.0] * function.numel_out(i) for i in range(function.n_out())]
    work = {}
    for k in range(function.n_instructions()):
        code, into, out_of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if code == ca.OP_OUTPUT:
            outputs[into[0]][into[1]] = work[out_of[0]]
        elif code == ca.OP_CONST:
            work[into[0]] = function.instruction_constant(k)
        elif code == ca.OP_INPUT:
            work[into[0]] = inputs[out_of[0]][out_of[1]]
        else:
            expr = _operation(code)(*(work[i] for i in out_of))
            if uses[k] > 1:
                m.shared[k] = expr
                expr = m.shared[k]
            work[into[0]] = expr
    return outputs


def _uses(function):
    """How often the value of each instruction is used; instructions share elements of casadi's work vector."""
    uses, maker = [0] * function.n_instructions(), {}
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        if code not in (ca.OP_INPUT, ca.OP_CONST):
            for element in function.instruction_input(k):
                uses[maker[element]] += 1
        if code != ca.OP_OUTPUT:
            maker[function.instruction_output(k)[0]] = k
    return uses


def _operation(code):
    if code not in OPERATIONS:
        name = next((n for n in dir(ca) if n.startswith('OP_') and getattr(ca, n) == code), code)
        raise FesdError('nlp_solver', f"no NL file can hold the model's operation {name}", "choose nlp_solver='ipopt'")
    return OPERATIONS[code]
