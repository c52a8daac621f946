"""Ipopt, the one inside casadi's wheel, built once for a graph and called with changing bounds, parameter and start."""

import io
import logging
import signal
import threading
import time
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass

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
    'print_level': 0,
    'sb': 'yes',
}
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


class _Deadline(ca.Callback):
    """Asks Ipopt to stop when the time is up."""

    def __init__(self, n, m, p, until):
        super().__init__()
        self._sizes, self._until = (n, m, p), until
        self.construct('deadline', {})

    def get_n_in(self):
        return ca.nlpsol_n_out()

    def get_n_out(self):
        return 1

    def get_sparsity_in(self, i):
        n, m, p = self._sizes
        length = {'x': n, 'lam_x': n, 'f': 1, 'g': m, 'lam_g': m, 'lam_p': p}[ca.nlpsol_out(i)]
        return ca.Sparsity.dense(length, 1)

    def eval(self, arg):
        return [float(time.perf_counter() > self._until)]


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
        settings = {'print_time': False, 'ipopt': IPOPT | options}
        if jacobian is not None:
            settings['jac_g'] = ca.Function('nlp_jac_g', [x, p], [g, jacobian], ['x', 'p'], ['g', 'jac_g_x'])
        if deadline is not None:
            self._deadline = _Deadline(x.numel(), g.numel(), p.numel(), deadline)
            settings['iteration_callback'] = self._deadline
        self._solver = ca.nlpsol(name, 'ipopt', {'x': x, 'p': p, 'f': f, 'g': g}, settings)

    def solve(self, w0, p, lbx, ubx, lbg, ubg):
        """Solve from ``w0``; never raises for an unsolved problem, the status says it."""
        said = io.StringIO()
        with redirect_stderr(said), _interruptible():
            result = self._solver(x0=w0, p=p, lbx=lbx, ubx=ubx, lbg=lbg, ubg=ubg)
        if said.getvalue():
            logger.debug("casadi: %s", said.getvalue())
        stats = self._solver.stats()
        w, lam_g, lam_x = (np.asarray(result[key], dtype=float).ravel() for key in ('x', 'lam_g', 'lam_x'))
        return NlpResult(w, float(result['f']), stats['return_status'], int(stats['iter_count']), lam_g, lam_x)
