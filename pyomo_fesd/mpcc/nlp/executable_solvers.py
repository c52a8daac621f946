"""NLP solvers that are executables and read NL files, driven by Pyomo.

The SX graph becomes a small Pyomo model once; a solve only changes bounds, parameters and start values on it.
"""

import importlib
import logging
import os
import re
import subprocess
import tempfile
from contextlib import contextmanager
from functools import cache, partial

import casadi as ca
import numpy as np
import pyomo.environ as pyo
from pyomo.common.errors import ApplicationError
from pyomo.common.tempfiles import TempfileManager
from pyomo.opt import ProblemFormat
from pyomo.opt.base.solvers import UnknownSolver

from pyomo_fesd.core import REDIRECTION, DeferredInterrupt, withheld_messages
from pyomo_fesd.mpcc.nlp.deadline import Deadline
from pyomo_fesd.mpcc.nlp.solver import (
    IPOPT,
    NlpResult,
    NlpSolver,
    accepted,
    as_sx,
    bound_multipliers,
    check_options,
    lagrangian_gradient,
    rows_with_variables,
    violated,
)
from pyomo_fesd.mpcc.nlp.sx_to_pyomo import sx_to_pyomo

logger = logging.getLogger('pyomo_fesd')

#: Solvers that Pyomo knows only after an import.
PLUGINS = {'pounce': 'pyomo_pounce'}
#: Executables that take Ipopt's options; only these get our defaults, since option names are not standardised.
LIKE_IPOPT = ('ipopt', 'pounce')
#: Status of an NLP that had no time left.
OUT_OF_TIME = 'time limit'
ITERATIONS = re.compile(r'Number of Iterations\.*:\s*(\d+)')


class Executable(NlpSolver):
    """An executable.  See ``NlpSolver``.

    Pyomo stops it at the deadline (``timelimit``); one with Ipopt's options also gets ``max_cpu_time``, so that it returns a point.

    Parameters
    ----------
    solver : str
        name for Pyomo's ``SolverFactory``
    """

    def __init__(self, solver, name, x, p, f, g, budget, deadline=None, derivatives=None, options=None, warm=None, shifts=False):
        options = options or {}
        check_options(solver, options, partial(_refusal, solver))
        defaults = {key: value for key, value in (IPOPT | budget).items() if key not in ('print_level', 'sb')}
        self._options = (_accepted(solver, tuple(defaults.items())) if _like_ipopt(solver) else {}) | options
        self._solver, self._deadline, self._limits_itself = solver, deadline or Deadline(), _like_ipopt(solver)
        x, p, f, g, _ = as_sx(x, p, f, g)
        self._model = sx_to_pyomo(x, p, f, g)
        self._constant = ~rows_with_variables(g, x)
        self._values, self._lagrangian = ca.Function('values', [x, p], [f, g]), lagrangian_gradient(x, p, f, g)

    @staticmethod
    def missing(name):
        """The reason why Pyomo cannot use the executable, or None."""
        if name in PLUGINS:
            importlib.import_module(PLUGINS[name])
        # Pyomo replaces the handlers of the root logger meanwhile
        with REDIRECTION, withheld_messages('pyomo'):
            solver = pyo.SolverFactory(name)
            if isinstance(solver, UnknownSolver) or not solver.available(exception_flag=False):
                return "Pyomo finds no working executable"
            reads_nl = hasattr(solver, 'problem_format') and solver.problem_format() == ProblemFormat.nl
        return None if reads_nl else "Pyomo's solver of this name does not read NL files"

    def solve(self, w0, p, lbx, ubx, lbg, ubg, duals=None, max_iter=None, steepest=np.inf, stalls=(), fall=None):
        """Solve from ``w0``; see ``NlpSolver``.  Multipliers to start from are not used, and none are shown on the way."""
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
        with withheld_messages('pyomo') as messages, _temporary_files():
            log = TempfileManager.create_tempfile(suffix='.log')
            try:
                results = pyo.SolverFactory(self._solver).solve(
                    self._model, load_solutions=False, options=self._limited(left, max_iter), timelimit=left, logfile=log
                )
            except subprocess.TimeoutExpired:
                return OUT_OF_TIME, 0, False
            except ApplicationError:
                logger.debug("%s: %s", self._solver, _text(messages))
                return 'error', 0, False
            except ValueError as error:
                if 'No variables appear' not in str(error):
                    raise
                # every variable is fixed: the point within the bounds is the solution
                return 'optimal', 0, True
            if len(results.solution):
                self._model.solutions.load_from(results)
            return _status(results.solver), _iterations(log), len(results.solution) > 0

    def _limited(self, left, max_iter):
        """The options with the limits of one call, for an executable that has Ipopt's."""
        options = dict(self._options)
        if self._limits_itself and left is not None:
            options.setdefault('max_cpu_time', left)
        if self._limits_itself and max_iter is not None:
            options['max_iter'] = max_iter
        return options

    def _result(self, w, p, lbx, ubx, status, iterations=0, lam_g=None):
        """The result at ``w``; all multipliers are zero without those of the rows."""
        w = np.array(w, dtype=float)
        f = float(self._values(w, p)[0])
        if lam_g is None:
            return NlpResult(w, f, status, iterations, np.zeros(len(self._constant)), np.zeros(len(w)))
        lam_x = bound_multipliers(self._lagrangian(w, p, lam_g).full().ravel(), lbx, ubx)
        return NlpResult(w, f, status, iterations, lam_g, lam_x)


def _status(answer):
    """Pyomo's 'optimal', otherwise the solver's own message: Pyomo reports every limit as an iteration limit."""
    condition = str(answer.termination_condition)
    return condition if condition == 'optimal' else str(answer.message).rsplit('\\x3a', 1)[-1].strip() or condition


def _iterations(log):
    """The last number of iterations in Ipopt's log, 0 without one."""
    with open(log) as stream:
        counts = ITERATIONS.findall(stream.read())
    return int(counts[-1]) if counts else 0


def _like_ipopt(solver):
    """Whether the executable of this name (``'pounce'``, ``'asl:ipopt'``, ``'/opt/bin/ipopt'``) takes Ipopt's options."""
    return os.path.splitext(os.path.basename(solver.split(':', 1)[-1]))[0] in LIKE_IPOPT


def _bound(number):
    return number if np.isfinite(number) else None


def _refusal(solver, options):
    """The executable's message if it refuses these options on a tiny problem, else None."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=0, bounds=(0, 2))
    m.f = pyo.Objective(expr=(m.x - 1) ** 2)
    with withheld_messages('pyomo') as messages, _temporary_files():
        try:
            pyo.SolverFactory(solver).solve(m, load_solutions=False, options=options)
        except ApplicationError:
            return _text(messages)
    return None


@contextmanager
def _temporary_files():
    """Context after which no file is left, also of a solver that fails or is interrupted."""
    with DeferredInterrupt() as interrupt, tempfile.TemporaryDirectory() as folder:
        before, TempfileManager.tempdir = TempfileManager.tempdir, folder
        try:
            # a solver stopped half-way leaves its context on the stack of temporary files, which this one clears with a warning
            with interrupt.raising(), TempfileManager:
                yield
        finally:
            TempfileManager.tempdir = before


def _text(messages):
    return '\n'.join(record.getMessage() for record in messages)


@cache
def _accepted(solver, defaults):
    return accepted(dict(defaults), partial(_refusal, solver))
