"""The system's Ipopt through cyipopt, with casadi's functions and exact derivatives."""

import io
from functools import cache

import casadi as ca
import cyipopt
import numpy as np
from pyomo.common.tee import capture_output

from pyomo_fesd.core import REDIRECTION, DeferredInterrupt
from pyomo_fesd.mpcc.compile import automatic
from pyomo_fesd.mpcc.nlp.deadline import Deadline
from pyomo_fesd.mpcc.nlp.solver import (
    IPOPT,
    IPOPT_WARM,
    NlpResult,
    NlpSolver,
    accepted,
    as_sx,
    bound_multipliers,
    check_options,
    lagrangian_gradient,
)

#: Ipopt's status by number, in the words that casadi reports.
STATUS = {
    0: 'Solve_Succeeded',
    1: 'Solved_To_Acceptable_Level',
    2: 'Infeasible_Problem_Detected',
    3: 'Search_Direction_Becomes_Too_Small',
    4: 'Diverging_Iterates',
    5: 'User_Requested_Stop',
    6: 'Feasible_Point_Found',
    -1: 'Maximum_Iterations_Exceeded',
    -2: 'Restoration_Failed',
    -3: 'Error_In_Step_Computation',
    -4: 'Maximum_CpuTime_Exceeded',
    -5: 'Maximum_WallTime_Exceeded',
    -10: 'Not_Enough_Degrees_Of_Freedom',
    -11: 'Invalid_Problem_Definition',
    -12: 'Invalid_Option',
    -13: 'Invalid_Number_Detected',
    -100: 'Unrecoverable_Exception',
    -101: 'NonIpopt_Exception_Thrown',
    -102: 'Insufficient_Memory',
    -199: 'Internal_Error',
}
SILENT = {'print_level': 0, 'sb': 'yes'}


class _Callbacks:
    """The functions that Ipopt calls, in cyipopt's names, for one value of the parameter."""

    def __init__(self, functions, jacobian, hessian, deadline):
        self._functions, self._structures, self._deadline = functions, (jacobian, hessian), deadline
        self.p, self.iterations, self.interrupt = [], 0, DeferredInterrupt()

    def _value(self, which, *args):
        """The nonzeros; Ipopt shortens its step where they are not finite."""
        value = self._functions[which](*args).full().ravel()
        if not np.isfinite(value).all():
            raise cyipopt.CyIpoptEvaluationError(which)
        return value

    def objective(self, x):
        return self._value('f', x, self.p)[0]

    def gradient(self, x):
        return self._value('gradient', x, self.p)

    def constraints(self, x):
        return self._value('g', x, self.p)

    def jacobian(self, x):
        return self._value('jacobian', x, self.p)

    def jacobianstructure(self):
        return self._structures[0]

    def hessian(self, x, lam, weight):
        return self._value('hessian', x, self.p, lam, weight)

    def hessianstructure(self):
        return self._structures[1]

    def intermediate(self, mode, iteration, *args):
        self.iterations = iteration
        return not (self._deadline.expired() or self.interrupt.pressed)


class CyIpopt(NlpSolver):
    """Ipopt of the system.  Our defaults that its version does not know are left out.  See ``NlpSolver``."""

    def __init__(self, name, x, p, f, g, budget, deadline=None, derivatives=None, options=None, warm=None, shifts=False):
        x, p, f, g, derivatives = as_sx(x, p, f, g, derivatives)
        d = derivatives or automatic(x, f, g)
        # Ipopt expects the lower triangle
        hessian = d.hessian.T
        functions = {
            'f': ca.Function('f', [x, p], [f]),
            'g': ca.Function('g', [x, p], [ca.densify(g)]),
            'gradient': ca.Function('gradient', [x, p], [ca.densify(d.gradient)]),
            'jacobian': ca.Function('jacobian', [x, p], [d.jacobian.nz[:]]),
            'hessian': ca.Function('hessian', [x, p, d.lam_g, d.lam_f], [hessian.nz[:]]),
        }
        self._callbacks = _Callbacks(functions, _structure(d.jacobian), _structure(hessian), deadline or Deadline())
        self._f, self._lagrangian = functions['f'], lagrangian_gradient(x, p, f, g)
        options = options or {}
        check_options('cyipopt', options, _refusal)
        self._options = _accepted(tuple((IPOPT | budget).items())) | options
        self._warm = _accepted(tuple(((warm or {}) | IPOPT_WARM).items())) | options

    def solve(self, w0, p, lbx, ubx, lbg, ubg, duals=None, max_iter=None, steepest=np.inf, stalls=(), fall=None):
        """Solve from ``w0``; see ``NlpSolver``.  Older Ipopts do not show multipliers on their way; ``fall`` is not used."""
        callbacks = self._callbacks
        callbacks.p, callbacks.iterations = p, 0
        problem = cyipopt.Problem(n=len(lbx), m=len(lbg), problem_obj=callbacks, lb=lbx, ub=ubx, cl=lbg, cu=ubg)
        settings, start = dict(self._options), {}
        if duals is not None:
            settings |= self._warm
            start = {'lagrange': duals.lam_g, 'zl': np.maximum(-duals.lam_x, 0.0), 'zu': np.maximum(duals.lam_x, 0.0)}
        if max_iter is not None:
            settings['max_iter'] = max_iter
        for key, value in settings.items():
            problem.add_option(key, value)
        with DeferredInterrupt() as callbacks.interrupt:
            w, info = problem.solve(np.array(w0, dtype=float), **start)
        problem.close()
        # unlike casadi's, older Ipopts give no multipliers to fixed variables
        lam_x = bound_multipliers(self._lagrangian(w, p, info['mult_g']).full().ravel(), lbx, ubx)
        return NlpResult(w, float(self._f(w, p)), STATUS[info['status']], callbacks.iterations, np.array(info['mult_g']), lam_x)


def _structure(matrix):
    """Rows and columns of the nonzeros."""
    return tuple(np.array(part, dtype=int) for part in matrix.sparsity().get_triplet())


@cache
def _accepted(defaults):
    return accepted(dict(defaults), _refusal)


class _Tiny:
    """An NLP on which options are tried."""

    def objective(self, x):
        return (x[0] - 1) ** 2

    def gradient(self, x):
        return 2 * (x - 1)


def _refusal(options):
    """Ipopt's message if it refuses these options, else None."""
    problem = cyipopt.Problem(n=1, m=0, problem_obj=_Tiny(), lb=[0.0], ub=[2.0])
    messages = io.StringIO()
    with REDIRECTION, capture_output(messages, capture_fd=True):
        try:
            for key, value in (SILENT | options).items():
                problem.add_option(key, value)
        except TypeError as error:
            return f'{messages.getvalue()} {error}'
        _, info = problem.solve(np.zeros(1))
    return "invalid value" if STATUS[info['status']] == 'Invalid_Option' else None
