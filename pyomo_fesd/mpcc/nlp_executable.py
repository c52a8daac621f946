"""NLP solvers that are executables and read NL files, driven by Pyomo.

The SX graph becomes a small Pyomo model once; a solve only changes bounds, parameters and start on it.  Shared sub-expressions
become named expressions, which the NL file shares as well.
"""

import importlib
import io
import logging
import operator
import os
import re
import subprocess
from functools import cache, partial

import casadi as ca
import numpy as np
import pyomo.environ as pyo
from pyomo.common.errors import ApplicationError
from pyomo.common.log import LoggingIntercept
from pyomo.common.tempfiles import TempfileManager
from pyomo.opt import ProblemFormat
from pyomo.opt.base.solvers import UnknownSolver

from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.deadline import Deadline
from pyomo_fesd.mpcc.nlp import (
    IPOPT,
    NlpResult,
    NlpSolver,
    accepted,
    bound_multipliers,
    check_options,
    lagrangian_gradient,
    rows_with_variables,
    violated,
)

logger = logging.getLogger('pyomo_fesd')

#: Solvers that Pyomo knows only after an import.
PLUGINS = {'pounce': 'pyomo_pounce'}
#: Executables that take Ipopt's options; our wishes are passed to no other one, there is no common language.
LIKE_IPOPT = ('ipopt', 'pounce')
#: Status of an NLP that had no time left.
OUT_OF_TIME = 'time limit'
ITERATIONS = re.compile(r'Number of Iterations\.*:\s*(\d+)')
#: casadi's operations in Pyomo's.
OPERATIONS = {
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
    ca.OP_EXP: pyo.exp,
    ca.OP_LOG: pyo.log,
    ca.OP_EXPM1: lambda a: pyo.exp(a) - 1,
    ca.OP_LOG1P: lambda a: pyo.log(1 + a),
    ca.OP_SQRT: pyo.sqrt,
    ca.OP_SIN: pyo.sin,
    ca.OP_COS: pyo.cos,
    ca.OP_TAN: pyo.tan,
    ca.OP_ASIN: pyo.asin,
    ca.OP_ACOS: pyo.acos,
    ca.OP_ATAN: pyo.atan,
    ca.OP_SINH: pyo.sinh,
    ca.OP_COSH: pyo.cosh,
    ca.OP_TANH: pyo.tanh,
    ca.OP_ASINH: pyo.asinh,
    ca.OP_ACOSH: pyo.acosh,
    ca.OP_ATANH: pyo.atanh,
    ca.OP_FLOOR: pyo.floor,
    ca.OP_CEIL: pyo.ceil,
}


class Executable(NlpSolver):
    """An executable.  See ``NlpSolver``.

    Ends by the deadline because Pyomo stops it then (``timelimit``); one like Ipopt gets ``max_cpu_time`` too, to give its point.

    Parameters
    ----------
    solver : str
        name for Pyomo's ``SolverFactory``
    """

    def __init__(self, solver, name, x, p, f, g, budget, deadline=None, derivatives=None, options=None):
        options = options or {}
        check_options(solver, options, partial(_complaint, solver))
        wishes = {key: value for key, value in (IPOPT | budget).items() if key not in ('print_level', 'sb')}
        self._options = (_accepted(solver, tuple(wishes.items())) if _like_ipopt(solver) else {}) | options
        self._solver, self._deadline, self._limits_itself = solver, deadline or Deadline(), _like_ipopt(solver)
        self._model = _to_pyomo(x, p, f, g)
        self._constant = ~rows_with_variables(g, x)
        self._values, self._lagrangian = ca.Function('values', [x, p], [f, g]), lagrangian_gradient(x, p, f, g)

    @staticmethod
    def missing(name):
        """Why Pyomo has no such executable; None if it has."""
        if name in PLUGINS:
            importlib.import_module(PLUGINS[name])
        with LoggingIntercept(io.StringIO(), 'pyomo'):
            solver = pyo.SolverFactory(name)
            if isinstance(solver, UnknownSolver) or not solver.available(exception_flag=False):
                return "Pyomo finds no working executable"
            reads_nl = hasattr(solver, 'problem_format') and solver.problem_format() == ProblemFormat.nl
        return None if reads_nl else "Pyomo's solver of this name reads no NL files"

    def solve(self, w0, p, lbx, ubx, lbg, ubg, duals=None, max_iter=None):
        """Solve from ``w0``; see ``NlpSolver``.  Multipliers to start from are not used."""
        left = self._deadline.left()
        if left == 0.0:
            return self._result(w0, p, lbx, ubx, OUT_OF_TIME)
        g = self._values(w0, p)[1].full().ravel()
        if np.any(violated(g, lbg, ubg) & self._constant):
            return self._result(w0, p, lbx, ubx, 'infeasible')
        self._set(np.clip(w0, lbx, ubx), p, lbx, ubx, lbg, ubg)
        status, iterations, found = self._run(left, max_iter)
        if not found:
            return self._result(w0, p, lbx, ubx, status, iterations)
        m = self._model
        w = np.array([v.value for v in m.x.values()], dtype=float)
        lam_g = np.zeros(len(lbg))
        for i, row in m.g.items():
            lam_g[i] = -m.dual.get(row, 0.0)
        return self._result(w, p, lbx, ubx, status, iterations, lam_g)

    def _set(self, w, p, lbx, ubx, lbg, ubg):
        m = self._model
        for v, start, lower, upper in zip(m.x.values(), w, lbx, ubx):
            v.set_value(start, skip_validation=True)
            v.bounds = (_bound(lower), _bound(upper))
        m.p.store_values(dict(enumerate(np.ravel(p).tolist())))
        m.lower.store_values(dict(enumerate(np.asarray(lbg, dtype=float).tolist())))
        m.upper.store_values(dict(enumerate(np.asarray(ubg, dtype=float).tolist())))
        m.dual.clear()

    def _run(self, left, max_iter):
        """Run the executable on the model; its status, its iterations, and whether it has left a point on the model."""
        options = dict(self._options)
        if left is not None and self._limits_itself:
            options.setdefault('max_cpu_time', left)
        if max_iter is not None and self._limits_itself:
            options['max_iter'] = max_iter
        said = io.StringIO()
        # a solver stopped half-way leaves its context on the stack of temporary files, which this one clears with a warning
        with LoggingIntercept(said, 'pyomo'), TempfileManager:
            log = TempfileManager.create_tempfile(suffix='.log')
            try:
                results = pyo.SolverFactory(self._solver).solve(
                    self._model, load_solutions=False, options=options, timelimit=left, logfile=log
                )
            except subprocess.TimeoutExpired:
                return OUT_OF_TIME, 0, False
            except ApplicationError:
                logger.debug("%s: %s", self._solver, said.getvalue())
                return 'error', 0, False
            except ValueError as error:
                if 'No variables appear' not in str(error):
                    raise
                # nothing left to decide: every point within the bounds will do
                return 'optimal', 0, True
            status, found = _status(results.solver), len(results.solution) > 0
            if found:
                self._model.solutions.load_from(results)
            with open(log) as stream:
                counted = ITERATIONS.findall(stream.read())
        return status, int(counted[-1]) if counted else 0, found

    def _result(self, w, p, lbx, ubx, status, iterations=0, lam_g=None):
        """The result at ``w``; without multipliers of the rows there are none at all."""
        w = np.array(w, dtype=float)
        f = float(self._values(w, p)[0])
        if lam_g is None:
            return NlpResult(w, f, status, iterations, np.zeros(len(self._constant)), np.zeros(len(w)))
        lam_x = bound_multipliers(self._lagrangian(w, p, lam_g).full().ravel(), lbx, ubx)
        return NlpResult(w, f, status, iterations, lam_g, lam_x)


def _status(told):
    """Pyomo's 'optimal', otherwise what the solver itself says: Pyomo calls every limit the iterations'."""
    condition = str(told.termination_condition)
    return condition if condition == 'optimal' else str(told.message).rsplit('\\x3a', 1)[-1].strip() or condition


def _like_ipopt(solver):
    """Whether the executable of this name (``'pounce'``, ``'asl:ipopt'``, ``'/opt/bin/ipopt'``) takes Ipopt's options."""
    return os.path.splitext(os.path.basename(solver.split(':', 1)[-1]))[0] in LIKE_IPOPT


def _bound(number):
    return number if np.isfinite(number) else None


def _complaint(solver, options):
    """What the executable says against these options on a tiny problem; None if it takes them."""
    m, said = pyo.ConcreteModel(), io.StringIO()
    m.x = pyo.Var(initialize=0, bounds=(0, 2))
    m.f = pyo.Objective(expr=(m.x - 1) ** 2)
    with LoggingIntercept(said, 'pyomo'):
        try:
            pyo.SolverFactory(solver).solve(m, load_solutions=False, options=options)
        except ApplicationError:
            return said.getvalue()
    return None


@cache
def _accepted(solver, wishes):
    return accepted(dict(wishes), partial(_complaint, solver))


def _to_pyomo(x, p, f, g):
    """The graph as a model: variables ``x``, parameters ``p``, objective ``f``, rows ``g`` between ``lower`` and ``upper``."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(x.numel()))
    m.p = pyo.Param(range(p.numel()), mutable=True, initialize=0.0)
    m.shared = pyo.Expression(pyo.NonNegativeIntegers)
    (objective,), rows = _expressions(ca.Function('nlp', [x, p], [f, ca.densify(g)]), [list(m.x.values()), list(m.p.values())], m)
    m.lower = pyo.Param(range(len(rows)), mutable=True, initialize=-np.inf)
    m.upper = pyo.Param(range(len(rows)), mutable=True, initialize=np.inf)
    m.f = pyo.Objective(expr=objective)
    m.g = pyo.Constraint(np.flatnonzero(rows_with_variables(g, x)).tolist(), rule=lambda m, i: (m.lower[i], rows[i], m.upper[i]))
    m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    return m


def _expressions(function, inputs, m):
    """The outputs of an SX function as expressions of its ``inputs``; what is used more than once is named in ``m.shared``."""
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
    """How often the value of each instruction is used; places of the work vector are used again for others."""
    uses, maker = [0] * function.n_instructions(), {}
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        if code not in (ca.OP_INPUT, ca.OP_CONST):
            for place in function.instruction_input(k):
                uses[maker[place]] += 1
        if code != ca.OP_OUTPUT:
            maker[function.instruction_output(k)[0]] = k
    return uses


def _operation(code):
    if code not in OPERATIONS:
        name = next((n for n in dir(ca) if n.startswith('OP_') and getattr(ca, n) == code), code)
        raise FesdError('nlp_solver', f"no NL file can hold the model's operation {name}", "choose nlp_solver='ipopt'")
    return OPERATIONS[code]
