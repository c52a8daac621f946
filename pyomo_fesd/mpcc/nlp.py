"""The NLP solvers to choose from, by the option ``nlp_solver``, and what they have in common.

Takes: the name of one.
Leaves: a class with the contract of ``NlpSolver``; its module, and with it what is optional, is imported only then.
"""

import importlib
import signal
import threading
from abc import ABC, abstractmethod
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca
import numpy as np

from pyomo_fesd.errors import FesdError

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
IPOPT_WARM = {'warm_start_init_point': 'yes'} | {
    f'warm_start_{name}': 1e-6 for name in ('bound_push', 'bound_frac', 'slack_bound_push', 'slack_bound_frac', 'mult_bound_push')
}
#: What the solvers say of a stationary, feasible point: Ipopt, Uno, and an executable in Pyomo's words.
SOLVED = (
    'Solve_Succeeded',
    'Solved_To_Acceptable_Level',
    'Feasible_Point_Found',
    'Converged with feasible KKT point',
    'optimal',
)
#: A row without variables may miss its bounds by this much.
ROW_TOLERANCE = 1e-8
#: ``nlp_solver`` -> module, class, how to get it; every other name is an executable.
NLP_SOLVERS = {
    'ipopt': ('nlp_casadi', 'CasadiIpopt', "pip install casadi"),
    'uno': ('nlp_casadi', 'CasadiUno', "pip install 'casadi>=3.8'"),
    'cyipopt': (
        'nlp_cyipopt',
        'CyIpopt',
        "pip install cyipopt, on Debian or Ubuntu after apt-get install coinor-libipopt-dev liblapack-dev libblas-dev pkg-config "
        "gcc g++",
    ),
}
EXECUTABLE = (
    'nlp_executable',
    'Executable',
    "for 'pounce': pip install pyomo-pounce; for others, put an executable that reads NL files on the PATH, or give its path",
)


@dataclass(frozen=True)
class NlpResult:
    """Outcome of one NLP: point, the solver's own status, iterations, multipliers of rows and bounds (casadi's sign).

    The gradient of ``f + lam_g g + lam_x w`` is zero: a multiplier is positive where an upper bound holds the point.
    """

    w: np.ndarray
    f: float
    status: str
    iterations: int
    lam_g: np.ndarray
    lam_x: np.ndarray

    @property
    def solved(self):
        """Whether the solver reports a stationary, feasible point."""
        return self.status in SOLVED

    def shortened(self, n):
        """The same result with the first ``n`` variables' values."""
        return replace(self, w=self.w[:n])

    def with_multipliers(self, lam_x, lam_g):
        """The same result with other multipliers, to start another NLP from."""
        return replace(self, lam_x=lam_x, lam_g=lam_g)


class NlpSolver(ABC):
    """``min f(w; p)  s.t.  lbg <= g(w; p) <= ubg, lbx <= w <= ubx``, built once, for changing bounds and parameter p.

    Parameters
    ----------
    name : str
    x, p, f, g : SX
    budget : dict
        our wishes, in Ipopt's names (``max_iter``, ``tol``, ``mu_init``, ...); each solver follows those that it has
    deadline : Deadline, optional
    derivatives : Derivatives, optional
        where they are known more cheaply than casadi finds them
    options : dict, optional
        the user's, in the solver's own names; they are passed through and win

    Raises
    ------
    FesdError
        naming an option that the solver refuses
    """

    @staticmethod
    def missing(name):
        """Why the solver ``name`` cannot be used; None if it can."""
        return None

    @abstractmethod
    def __init__(self, name, x, p, f, g, budget, deadline=None, derivatives=None, options=None):
        pass

    @abstractmethod
    def solve(self, w0, p, lbx, ubx, lbg, ubg, duals=None, max_iter=None):
        """Solve from ``w0``; never raises for an unsolved problem, the status says it.

        Infinite bounds are ``np.inf``; a row or variable with two of them is free, one with equal bounds is an equation or fixed.

        Parameters
        ----------
        duals : NlpResult, optional
            multipliers to start from, where the solver can use them
        max_iter : int, optional
            iterations that this call may use, where they can be counted

        Returns
        -------
        NlpResult
            with the last point, whatever the status
        """


def nlp_solver(name):
    """The class (or a callable with its signature) of the solver ``name``.

    Parameters
    ----------
    name : str
        a key of ``NLP_SOLVERS``, or what Pyomo's ``SolverFactory`` makes an executable of that reads NL files: ``'pounce'``,
        ``'asl:ipopt'`` (``'ipopt'`` alone is casadi's), a path

    Raises
    ------
    FesdError
        saying how to get a solver that is not there
    """
    module, kind, get = NLP_SOLVERS.get(name, EXECUTABLE)
    try:
        kind = getattr(importlib.import_module(f'pyomo_fesd.mpcc.{module}'), kind)
        reason = kind.missing(name)
    except ImportError as error:
        reason = str(error)
    if reason:
        others = ', '.join(f"'{other}'" for other in NLP_SOLVERS if other != name)
        raise FesdError(f"nlp_solver='{name}'", f"this NLP solver is not there: {reason}", f"{get}; or choose among {others}")
    return kind if name in NLP_SOLVERS else partial(kind, name)


def check_options(name, options, complaint, where='nlp_options'):
    """Raise if the solver refuses the user's options, with the name of the one that it refuses.

    Parameters
    ----------
    complaint : callable dict -> str or None
        what the solver says against these options
    where : str
        how the user gives them
    """
    said = complaint(options) if options else None
    if said is None:
        return
    key, shown = ', '.join(options), 'this combination'
    # some make sense only together, so each alone is asked only now
    for alone, value in options.items():
        against = complaint({alone: value})
        if against is not None:
            key, shown, said = alone, repr(value), against
            break
    raise FesdError(
        f"{where}['{key}']",
        f"{name} refuses {shown}: {' '.join(said.split())}",
        f"{where} go to {name} unchanged: take names and values from its documentation",
    )


def accepted(wishes, complaint):
    """Those of our ``wishes`` (dict) that the solver takes."""
    if complaint(wishes) is None:
        return wishes
    return {key: value for key, value in wishes.items() if complaint({key: value}) is None}


def bound_multipliers(gradient, lbx, ubx):
    """Multipliers of the bounds that make a point stationary, from the gradient of ``f + lam_g g`` there."""
    return np.clip(-gradient, np.where(np.isfinite(lbx), -np.inf, 0.0), np.where(np.isfinite(ubx), np.inf, 0.0))


def rows_with_variables(g, x):
    """Mask over the rows; some solvers cannot take one without variables: it holds or it does not."""
    rows = np.zeros(g.numel(), dtype=bool)
    rows[ca.jacobian(g, x).sparsity().row()] = True
    return rows


def violated(g, lbg, ubg):
    """Mask over the rows with values ``g``."""
    return (g < lbg - ROW_TOLERANCE) | (g > ubg + ROW_TOLERANCE)


@contextmanager
def interruptible():
    """Let Ctrl-C through: a solver turns it into a status of its own, so it is remembered here and raised again afterwards."""
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


def lagrangian_gradient(x, p, f, g):
    """Function (x, p, lam_g) -> gradient of ``f + lam_g g`` by x."""
    lam = ca.SX.sym('lam', g.numel())
    return ca.Function('gradient', [x, p, lam], [ca.densify(ca.gradient(f + ca.dot(lam, g), x))])
