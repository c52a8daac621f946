"""Ipopt, the one inside casadi's wheel, built once for a graph and called with changing bounds, parameter and start."""

import io
import logging
import signal
import threading
import time
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

logger = logging.getLogger('pyomo_fesd')

#: Measured as clearly the best of five settings on switching problems; the default monotone one fails on most of them.
IPOPT = {
    'bound_relax_factor': 0.0,
    'mu_strategy': 'adaptive',
    'mu_oracle': 'quality-function',
    'least_square_init_duals': 'yes',
    # MUMPS' own permutation for scaling takes most of the time on these systems and gains nothing
    'mumps_permuting_scaling': 0,
    # dependent constraints are the rule here: G = 0 and H = 0 both follow where a pair is bi-active
    'perturb_always_cd': 'yes',
    'print_level': 0,
    'sb': 'yes',
}
#: For a start with multipliers: neither they nor the point are pushed far from their bounds.
WARM_DUALS = {'warm_start_init_point': 'yes'} | {
    f'warm_start_{name}': 1e-6 for name in ('bound_push', 'bound_frac', 'slack_bound_push', 'slack_bound_frac', 'mult_bound_push')
}
NOT_BEGUN = ('Not_Enough_Degrees_Of_Freedom', 'Invalid_Problem_Definition', 'Invalid_Option')
SOLVED = ('Solve_Succeeded', 'Solved_To_Acceptable_Level', 'Feasible_Point_Found')


@dataclass(frozen=True)
class NlpResult:
    """Outcome of one NLP: point, Ipopt's own status, iterations, multipliers of the rows (casadi's sign)."""

    w: np.ndarray
    f: float
    status: str
    iterations: int
    lam_g: np.ndarray
    lam_x: np.ndarray

    @property
    def solved(self):
        """Whether Ipopt reports a stationary, feasible point."""
        return self.status in SOLVED

    def shortened(self, n):
        """The same result with the first ``n`` variables' values."""
        return replace(self, w=self.w[:n])

    def with_multipliers(self, lam_x, lam_g):
        """The same result with other multipliers, to start another NLP from."""
        return replace(self, lam_x=lam_x, lam_g=lam_g)


@contextmanager
def _interruptible():
    """Let Ctrl-C through: casadi turns it into an Ipopt status, so it is remembered here and raised again afterwards."""
    pressed = []

    def remember(*args):
        pressed.append(True)
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, remember)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if pressed:
        raise KeyboardInterrupt


class _Watch(ca.Callback):
    """Asks Ipopt to stop when the time is up or the iterations that this call may use are spent."""

    def __init__(self, n, m, p, until):
        super().__init__()
        self._sizes, self._until, self.left = (n, m, p), until, None
        self.construct('watch', {})

    def get_n_in(self):
        return ca.nlpsol_n_out()

    def get_n_out(self):
        return 1

    def get_sparsity_in(self, i):
        n, m, p = self._sizes
        length = {'x': n, 'lam_x': n, 'f': 1, 'g': m, 'lam_g': m, 'lam_p': p}[ca.nlpsol_out(i)]
        return ca.Sparsity.dense(length, 1)

    def eval(self, arg):
        if self.left is not None:
            self.left -= 1
            if self.left < 0:
                return [1.0]
        return [float(self._until is not None and time.perf_counter() > self._until)]


class Nlp:
    """``min f(w; p)  s.t.  lbg <= g(w) <= ubg, lbx <= w <= ubx`` for changing bounds and parameter p.

    Parameters
    ----------
    x, p, f, g : SX
    options : dict
        Ipopt options, over ``IPOPT``
    deadline : float or None
        value of ``time.perf_counter()`` at which to stop
    jacobian : SX, optional
        of g by x, where it is known more cheaply than casadi finds it (one dense column defeats its colouring)
    """

    def __init__(self, name, x, p, f, g, options, deadline=None, jacobian=None):
        self._watch = _Watch(x.numel(), g.numel(), p.numel(), deadline)
        self._settings = {'print_time': False, 'ipopt': IPOPT | options, 'iteration_callback': self._watch}
        if jacobian is not None:
            self._settings['jac_g'] = ca.Function('nlp_jac_g', [x, p], [g, jacobian], ['x', 'p'], ['g', 'jac_g_x'])
        self._problem = {'x': x, 'p': p, 'f': f, 'g': g}
        self._name = name
        self._cold, self._warm = ca.nlpsol(name, 'ipopt', self._problem, self._settings), None

    def _solver(self, duals):
        """The solver for a start without or with multipliers; both use the same derivatives."""
        if duals is None:
            return self._cold
        if self._warm is None:
            derivatives = {
                option: self._cold.get_function(name)
                for option, name in (('grad_f', 'nlp_grad_f'), ('jac_g', 'nlp_jac_g'), ('hess_lag', 'nlp_hess_l'))
            }
            settings = self._settings | derivatives | {'ipopt': WARM_DUALS | self._settings['ipopt']}
            self._warm = ca.nlpsol(self._name, 'ipopt', self._problem, settings)
        return self._warm

    def solve(self, w0, p, lbx, ubx, lbg, ubg, duals=None, max_iter=None):
        """Solve from ``w0``; never raises for an unsolved problem, the status says it.

        Parameters
        ----------
        duals : NlpResult, optional
            multipliers to start from
        max_iter : int, optional
            iterations that this call may use
        """
        solver = self._solver(duals)
        self._watch.left = max_iter
        start = {} if duals is None else {'lam_x0': duals.lam_x, 'lam_g0': duals.lam_g}
        said = io.StringIO()
        with redirect_stderr(said), _interruptible():
            result = solver(x0=w0, p=p, lbx=lbx, ubx=ubx, lbg=lbg, ubg=ubg, **start)
        if said.getvalue():
            logger.debug("casadi: %s", said.getvalue())
        stats = solver.stats()
        w, lam_g, lam_x = (np.asarray(result[key], dtype=float).ravel() for key in ('x', 'lam_g', 'lam_x'))
        return NlpResult(w, float(result['f']), stats['return_status'], _iterations(stats), lam_g, lam_x)


def _iterations(stats):
    """Ipopt leaves its counter unset when it does not begin."""
    return int(stats['iter_count']) if stats['return_status'] not in NOT_BEGUN else 0
