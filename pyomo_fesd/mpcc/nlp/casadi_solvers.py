"""The NLP solvers inside casadi's wheel: Ipopt (the default) and Uno."""

import ctypes
import io
import os
from abc import abstractmethod
from collections import deque
from dataclasses import replace
from functools import cache, cached_property

import casadi as ca
import numpy as np
from pyomo.common.tee import capture_output

from pyomo_fesd.core import REDIRECTION, DeferredInterrupt
from pyomo_fesd.mpcc.compile import automatic
from pyomo_fesd.mpcc.nlp.deadline import Deadline
from pyomo_fesd.mpcc.nlp.hessian_shift import HessianShift
from pyomo_fesd.mpcc.nlp.solver import (
    DIVERGING,
    IPOPT,
    IPOPT_WARM,
    RUNNING,
    STALLED,
    VIOLATED,
    NlpResult,
    NlpSolver,
    as_sx,
    check_options,
    rows_with_variables,
    violated,
)

#: Variables and rows from which Uno's sequential quadratic programming, much the better of its presets, gets too slow.
UNO_LARGE = 2000
#: Variables from which a Hessian is shifted: that takes 0.3 ms an iteration (681 iterations with 600 variables), and factorizations
#: of smaller problems are cheap.
SHIFTED = 500
#: Ipopt's option names in Uno's.
UNO_NAMES = {
    'max_iter': ('max_iterations',),
    'tol': ('primal_tolerance', 'dual_tolerance'),
    'mu_init': ('barrier_initial_parameter',),
    'bound_push': ('barrier_push_variable_to_interior_k1',),
    'bound_frac': ('barrier_push_variable_to_interior_k2',),
}
#: casadi's status where it is more specific than Uno's own "not optimal point".
UNIFIED = {'SOLVER_RET_LIMITED': 'iteration or time limit', 'SOLVER_RET_NAN': 'error'}
#: Multipliers of parameters would take a derivative of their own (which Uno needs for other purposes).
WITHOUT_PARAMETERS = {'calc_lam_p': False, 'no_nlp_grad': True}
#: Statuses of the tiny problem that only refused options can cause.
REFUSED = ('Invalid_Option', 'error')
#: Statuses with which Ipopt leaves its iteration counter unset.
NOT_BEGUN = ('Not_Enough_Degrees_Of_Freedom', 'Invalid_Problem_Definition', 'Invalid_Option')
#: Uno's own numbers for the types of its options.
UNO_TYPES = {0: int, 1: float, 2: bool, 3: str}


class _Violations:
    """The least violation up to each of the last iterations, since it was last above the limit of a ``Stall``."""

    def __init__(self, limit):
        self._below, self._least = limit.below, deque(maxlen=limit.iterations + 1)

    def add(self, violation):
        if violation > self._below:
            self._least.clear()
        else:
            self._least.append(min([violation, *list(self._least)[-1:]]))

    @property
    def stall(self):
        """Whether they have not halved."""
        return len(self._least) == self._least.maxlen and self._least[-1] > max(VIOLATED, self._least[0] / 2)


class _Limit:
    """The limit of iterations of a call, which waits as long as the objective falls (``Fall``)."""

    def __init__(self, max_iter, fall):
        self._most, self._fall, self._number = np.inf if max_iter is None else max_iter, fall, 0
        self._objectives = deque(maxlen=1 if fall is None else fall.iterations + 1)

    def add(self, objective):
        self._number += 1
        self._objectives.append(objective)

    @property
    def is_reached(self):
        return self._number > self._most and not (self._falls and self._number <= self._fall.times * self._most)

    @property
    def _falls(self):
        first, last, is_full = self._objectives[0], self._objectives[-1], len(self._objectives) == self._objectives.maxlen
        return self._fall is not None and is_full and last < first - self._fall.part * abs(first)


class _StopCallback(ca.Callback):
    """Asks the solver to stop at the deadline, at the limits of a call, or at Ctrl-C."""

    def __init__(self, n, m, p, deadline):
        super().__init__()
        self._sizes, self._deadline, self.interrupt, self.after = (n, m, p), deadline, DeferredInterrupt(), None
        self._f, self._g, self._lam_g = map(ca.nlpsol_out().index, ('f', 'g', 'lam_g'))
        self.construct('watch', {})

    def begin(self, max_iter, steepest, stalls, fall, lbg, ubg, after=None):
        """Begin a call with its limits; ``after`` is called after each iteration."""
        self.after = after
        self._limit, self._steepest, self._running = _Limit(max_iter, fall), steepest, 0
        self._violations = [_Violations(limit) for limit in stalls]
        self._lbg, self._ubg = (np.asarray(bound, dtype=float) for bound in (lbg, ubg))

    @property
    def status(self):
        """The status of a call that was stopped by its own limits; None of another one."""
        return DIVERGING if self._running >= RUNNING else STALLED if any(v.stall for v in self._violations) else None

    def get_n_in(self):
        return ca.nlpsol_n_out()

    def get_n_out(self):
        return 1

    def get_sparsity_in(self, i):
        n, m, p = self._sizes
        length = {'x': n, 'lam_x': n, 'f': 1, 'g': m, 'lam_g': m, 'lam_p': p}[ca.nlpsol_out(i)]
        return ca.Sparsity.dense(length, 1)

    def has_eval_buffer(self):
        # avoids copies of the point, which is not used
        return True

    def eval_buffer(self, arg, res):
        if self.after is not None:
            self.after()
        # Uno does not show its objective
        self._limit.add(np.nan if arg[self._f] is None else arg[self._f].cast('d')[0])
        if self._steepest < np.inf or self._violations:
            self._look_at(*(np.frombuffer(arg[i].cast('B')) for i in (self._g, self._lam_g)))
        res[0].cast('d')[0] = self._limit.is_reached or bool(self.status) or self._deadline.expired() or self.interrupt.pressed
        return 0

    def _look_at(self, g, lam_g):
        """Count iterations with a violated row and a multiplier above its limit; keep the violation."""
        violation = max((self._lbg - g).max(initial=0.0), (g - self._ubg).max(initial=0.0))
        is_steep = violation > VIOLATED and np.abs(lam_g).max(initial=0.0) > self._steepest
        self._running = self._running + 1 if is_steep else 0
        for violations in self._violations:
            violations.add(violation)


class _CasadiNlp(NlpSolver):
    """Shared by both: casadi's ``nlpsol``.  See ``NlpSolver``."""

    #: Name of casadi's plug-in, options that silence it, whether it accepts our derivatives.
    PLUGIN, SILENT, TAKES_DERIVATIVES = '', {}, False
    #: Keyword by which the user gives its options.
    GIVEN = 'nlp_options'

    @staticmethod
    def missing(name):
        """The reason why casadi does not have it, or None."""
        return None if ca.has_nlpsol(name) else f"casadi {ca.__version__} was built without it"

    def __init__(self, name, x, p, f, g, budget, deadline=None, derivatives=None, options=None, warm=None, shifts=False):
        self._size, options = x.numel() + g.numel(), options or {}
        check_options(self.PLUGIN, options, self._refusal, self.GIVEN)
        self._watch = _StopCallback(x.numel(), g.numel(), p.numel(), deadline or Deadline())
        # casadi's warnings would go to the stderr of the whole process
        settings = {'print_time': False, 'show_eval_warnings': False, 'iteration_callback': self._watch}
        self._own, self._options, self._made = settings, options, {}
        self._budgets = {False: budget, True: budget | (warm or {})}
        self._name, self._problem, self._derivatives = name, {'x': x, 'p': p, 'f': f, 'g': g}, derivatives
        self._shift = HessianShift() if shifts and self.TAKES_DERIVATIVES and x.numel() >= SHIFTED else None

    @abstractmethod
    def _settings(self, budget, options, warm=False):
        """Options of the solver, for a start without or with multipliers."""

    def _status(self, stats):
        """The solver's own status from casadi's statistics."""
        return stats['return_status']

    def _refusal(self, options):
        """The solver's message if it refuses these options on a tiny problem, else None."""
        x, messages = ca.SX.sym('x'), io.StringIO()
        with REDIRECTION, capture_output(messages, capture_fd=True):
            try:
                settings = {'print_time': False, self.PLUGIN: self._settings({}, self.SILENT | options)}
                solver = ca.nlpsol('probe', self.PLUGIN, {'x': x, 'f': (x - 1) ** 2}, settings)
                solver(x0=0.0)
            except (RuntimeError, ValueError) as error:
                return f'{messages.getvalue()} {str(error).splitlines()[-1]}'
        return "invalid value" if self._status(solver.stats()) in REFUSED else None

    @cached_property
    def _given(self):
        """casadi's options without those of the solver itself."""
        if not self.TAKES_DERIVATIVES:
            return self._own
        x, p, f, g = self._problem.values()
        functions = derivative_functions(x, p, f, g, self._derivatives or automatic(x, f, g))
        if self._shift is not None:
            functions |= {'hess_lag': self._shift.shifted(functions['hess_lag'])}
        return self._own | WITHOUT_PARAMETERS | functions

    def _solver_for(self, warm):
        """The solver for a start without or with multipliers, made when it is first needed."""
        if warm not in self._made:
            settings = self._given | {self.PLUGIN: self._settings(self._budgets[warm], self._options, warm)}
            self._made[warm] = ca.nlpsol(self._name, self.PLUGIN, self._problem, settings)
        return self._made[warm]

    def solve(self, w0, p, lbx, ubx, lbg, ubg, duals=None, max_iter=None, steepest=np.inf, stalls=(), fall=None):
        """Solve from ``w0``; see ``NlpSolver``."""
        solver = self._solver_for(duals is not None)
        self._watch.begin(max_iter, steepest, stalls, fall, lbg, ubg, self._follows(solver))
        start = {} if duals is None else {'lam_x0': duals.lam_x, 'lam_g0': duals.lam_g}
        given = {'x0': w0, 'p': p, 'lbx': lbx, 'ubx': ubx, 'lbg': lbg, 'ubg': ubg} | start
        with DeferredInterrupt() as self._watch.interrupt:
            try:
                # casadi converts an array several times
                result = solver(**{name: ca.DM(numbers) for name, numbers in given.items()})
            except RuntimeError as error:
                if 'An exception was raised in the solver' not in str(error):
                    raise
                return self._failed(w0, p, len(lbg))
            finally:
                # it holds the solver, which holds the callback
                self._watch.after = None
        stats = solver.stats()
        w, lam_g, lam_x = (result[key].full().ravel() for key in ('x', 'lam_g', 'lam_x'))
        status = self._watch.status or self._status(stats)
        return NlpResult(w, float(result['f']), status, _iterations(stats), lam_g, lam_x)

    def _follows(self, solver):
        """What the shift of the Hessian does after each iteration of ``solver``; None without a shift."""
        if self._shift is None:
            return None
        self._shift.begin()
        return lambda: self._shift.follow(solver.stats()['iterations']['regularization_size'][-1])

    def _failed(self, w0, p, m, status='error'):
        """The result if the solver returns no point."""
        w = np.array(w0, dtype=float)
        f = ca.Function('f', [self._problem['x'], self._problem['p']], [self._problem['f']])(w, p)
        return NlpResult(w, float(f), status, 0, np.zeros(m), np.zeros(len(w)))


class CasadiIpopt(_CasadiNlp):
    """Ipopt.  See ``NlpSolver``."""

    PLUGIN, SILENT, TAKES_DERIVATIVES = 'ipopt', {'print_level': 0, 'sb': 'yes'}, True

    def _settings(self, budget, options, warm=False):
        return IPOPT | budget | (IPOPT_WARM if warm else {}) | options


class PlainIpopt(CasadiIpopt):
    """Ipopt with its own defaults.  See ``NlpSolver``."""

    GIVEN = 'options'

    def _settings(self, budget, options, warm=False):
        return budget | options


class CasadiUno(_CasadiNlp):
    """Uno as 'filtersqp' on small problems and 'ipopt' on large ones; ``preset`` is one of its options.  See ``NlpSolver``."""

    PLUGIN, SILENT = 'uno', {'logger': 'SILENT'}

    @staticmethod
    def missing(name):
        """The reason why casadi's Uno cannot be used, or None."""
        try:
            return _CasadiNlp.missing(name) or (_uno() and None)
        except (OSError, AttributeError) as error:
            return f"casadi {ca.__version__} has none with a C interface ({error})"

    def __init__(self, name, x, p, f, g, budget, deadline=None, derivatives=None, options=None, warm=None, shifts=False):
        x, p, f, g, derivatives = as_sx(x, p, f, g, derivatives)
        # with a violated row without variables Uno's QP solver may never return, whatever the limits
        self._varying, self._g = rows_with_variables(g, x), ca.Function('g', [x, p], [ca.densify(g)])
        super().__init__(name, x, p, f, g[np.flatnonzero(self._varying).tolist()], budget, deadline, derivatives, options, warm)

    def solve(self, w0, p, lbx, ubx, lbg, ubg, duals=None, max_iter=None, steepest=np.inf, stalls=(), fall=None):
        """Solve from ``w0``; see ``NlpSolver``."""
        varying = self._varying
        g, lam_g = self._g(w0, p).full().ravel(), np.zeros(len(varying))
        if np.any(violated(g, lbg, ubg) & ~varying):
            return self._failed(w0, p, len(varying), 'infeasible')
        if duals is not None:
            duals = replace(duals, lam_g=duals.lam_g[varying])
        result = super().solve(w0, p, lbx, ubx, lbg[varying], ubg[varying], duals, max_iter, steepest, stalls, fall)
        lam_g[varying] = result.lam_g
        return replace(result, lam_g=lam_g)

    def _settings(self, budget, options, warm=False):
        # options of a wrong type are dropped by casadi without a message
        ours = {new: value for old, value in budget.items() for new in UNO_NAMES.get(old, ())}
        ours |= {'logger': 'SILENT', 'preset': 'filtersqp' if self._size < UNO_LARGE else 'ipopt'}
        return {name: _uno_type(name)(value) for name, value in (ours | options).items()}

    def _status(self, stats):
        return UNIFIED.get(stats['unified_return_status'], stats['return_status'])


def derivative_functions(x, p, f, g, d) -> dict:
    """Return casadi's options for the ``Derivatives`` d.

    Ipopt asks these functions for derivatives only, but casadi would evaluate the values in their signatures all the same.
    """
    no_f, no_g = type(x)(1, 1), type(x)(g.numel(), 1)
    return {
        'grad_f': ca.Function('nlp_grad_f', [x, p], [no_f, ca.densify(d.gradient)], ['x', 'p'], ['f', 'grad_f_x']),
        'jac_g': ca.Function('nlp_jac_g', [x, p], [no_g, d.jacobian], ['x', 'p'], ['g', 'jac_g_x']),
        'hess_lag': ca.Function(
            'nlp_hess_l', [x, p, d.lam_f, d.lam_g], [d.hessian], ['x', 'p', 'lam_f', 'lam_g'], ['triu_hess_gamma_x_x']
        ),
    }


def _iterations(stats):
    return int(stats['iter_count']) if stats['return_status'] not in NOT_BEGUN else 0


def _uno_type(name):
    """The type of Uno's option ``name``, according to its C library."""
    uno, solver = _uno()
    kind = uno.uno_get_solver_option_type(solver, name.encode())
    if kind not in UNO_TYPES:
        raise ValueError("unknown option")
    return UNO_TYPES[kind]


@cache
def _uno():
    """Uno's C library and a solver of its own, or an OSError."""
    folder = os.path.dirname(ca.__file__)
    files = [f for f in (os.path.join(folder, f'libuno.{end}') for end in ('so', 'dylib', 'dll')) if os.path.exists(f)]
    if not files:
        raise OSError(f"no libuno in {folder}")
    uno = ctypes.CDLL(files[0])
    uno.uno_create_solver.restype = ctypes.c_void_p
    uno.uno_get_solver_option_type.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
    return uno, uno.uno_create_solver()
