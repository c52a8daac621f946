"""NLP solvers by the option ``nlp_solver``: their contract, their names and the functions that they share.

Takes: the name of one.
Leaves: a class with the contract of ``NlpSolver``.  Its module is imported only then, as it may need an optional package.
"""

import importlib
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import casadi as ca
import numpy as np

from pyomo_fesd.core import FesdError
from pyomo_fesd.mpcc.compile import Derivatives

#: Measured as clearly the best of five settings on MPCCs; Ipopt's default, the monotone strategy, fails on most of them.
IPOPT = {
    'bound_relax_factor': 0.0,
    'mu_strategy': 'adaptive',
    'mu_oracle': 'quality-function',
    'least_square_init_duals': 'yes',
    # MUMPS' own permutation for scaling takes most of the time on these systems without a gain
    'mumps_permuting_scaling': 0,
    # approximate minimum degree: quicker than MUMPS' own choice of an ordering on large systems of this kind
    'mumps_pivot_order': 0,
    # dependent constraints are the rule here: G = 0 and H = 0 both follow where a pair is bi-active
    'perturb_always_cd': 'yes',
    'print_level': 0,
    'sb': 'yes',
}
#: For a start with multipliers: neither they nor the point are pushed far from their bounds.
IPOPT_WARM = {'warm_start_init_point': 'yes'} | {
    f'warm_start_{name}': 1e-6 for name in ('bound_push', 'bound_frac', 'slack_bound_push', 'slack_bound_frac', 'mult_bound_push')
}
#: Status of a stationary, feasible point: Ipopt's, our own, Uno's, and Pyomo's for an executable; the first one is to looser
#: tolerances.
ACCEPTABLE = 'Solved_To_Acceptable_Level'
NEWTON = "Newton's method converged"
SOLVED = (
    'Solve_Succeeded',
    NEWTON,
    ACCEPTABLE,
    'Feasible_Point_Found',
    'Converged with feasible KKT point',
    'optimal',
)
#: Status of a run that was stopped as it did not halve the violation of its rows in the iterations of the call's limit.
STALLED = 'Violation_Stalls'
#: Status of a run that a limit has stopped.
STOPPED = ('User_Requested_Stop', 'Maximum_Iterations_Exceeded', 'iteration or time limit', 'maxIterations', STALLED)
#: Status of a run that was stopped as rows seem to contradict each other: in so many iterations running one was violated by more
#: than the second, and a multiplier was above the limit of the call.  A violation below the second one does not stall.
DIVERGING, RUNNING, VIOLATED = 'Multipliers_Diverge', 30, 1e-8
#: A row without variables may miss its bounds by this much.
ROW_TOLERANCE = 1e-8
#: ``nlp_solver`` -> module, class, how to install it; every other name is an executable.
NLP_SOLVERS = {
    'ipopt': ('casadi_solvers', 'CasadiIpopt', "pip install casadi"),
    'uno': ('casadi_solvers', 'CasadiUno', "pip install 'casadi>=3.8'"),
    'cyipopt': (
        'cyipopt_solver',
        'CyIpopt',
        "pip install cyipopt, on Debian or Ubuntu after apt-get install coinor-libipopt-dev liblapack-dev libblas-dev pkg-config "
        "gcc g++",
    ),
}
EXECUTABLE = (
    'executable_solvers',
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

    @property
    def is_exact(self):
        """Whether it is one to the tolerances that were asked for."""
        return self.solved and self.status != ACCEPTABLE

    @property
    def stopped(self):
        """Whether a limit has stopped the solver on its way."""
        return self.status in STOPPED

    def shortened(self, n):
        """The same result with the first ``n`` variables' values."""
        return replace(self, w=self.w[:n])

    def with_multipliers(self, lam_x, lam_g):
        """The same result with other multipliers, to start another NLP from."""
        return replace(self, lam_x=lam_x, lam_g=lam_g)


class Stall(NamedTuple):
    """The largest violation of a row has to halve in so many ``iterations``, as long as it stays at most ``below``."""

    iterations: int
    below: float = np.inf


class Fall(NamedTuple):
    """As long as the objective falls by this ``part`` of itself in so many ``iterations``, ``max_iter`` does not end a solve.

    So many ``times`` of ``max_iter`` do in any case.
    """

    part: float
    iterations: int
    times: float


class NlpSolver(ABC):
    """``min f(w; p)  s.t.  lbg <= g(w; p) <= ubg, lbx <= w <= ubx``, built once, for changing bounds and parameter p.

    Parameters
    ----------
    name : str
    x, p, f, g : SX or MX
    budget : dict
        our limits and tolerances in Ipopt's names (``max_iter``, ``tol``, ``mu_init``, ...); a solver ignores those that it does
        not have
    deadline : Deadline, optional
    derivatives : Derivatives, optional
        if they are cheaper than those that casadi finds
    options : dict, optional
        the user's, in the solver's own names; they override ours
    warm : dict, optional
        ``budget`` of a start with multipliers, besides the other one
    shifts : bool
        whether casadi's Ipopt gets a Hessian shifted by a part of what it last added itself (``HessianShift``), which pays where
        curvature is negative on most of the way

    Raises
    ------
    FesdError
        naming an option that the solver refuses
    """

    @staticmethod
    def missing(name):
        """The reason why the solver ``name`` cannot be used, or None."""
        return None

    @abstractmethod
    def __init__(self, name, x, p, f, g, budget, deadline=None, derivatives=None, options=None, warm=None, shifts=False):
        pass

    @abstractmethod
    def solve(self, w0, p, lbx, ubx, lbg, ubg, duals=None, max_iter=None, steepest=np.inf, stalls=(), fall=None):
        """Solve from ``w0``; an unsolved problem gives a status, never an error.

        Infinite bounds are ``np.inf``; a row or variable with two of them is free, one with equal bounds is an equation or fixed.

        Parameters
        ----------
        duals : NlpResult, optional
            multipliers to start from, where the solver can use them
        max_iter : int, optional
            iterations that this call may use, where they can be counted
        steepest : float
            limit of the multipliers of rows, where the solver shows them on its way: with larger ones, it ends as ``DIVERGING``
        stalls : sequence of Stall
            how the largest violation of a row has to shrink, where the solver shows it; if it does not, the solve ends as
            ``STALLED``
        fall : Fall, optional
            when ``max_iter`` does not end the solve yet; with casadi's Ipopt only

        Returns
        -------
        NlpResult
            with the last point, whatever the status
        """


def nlp_solver(name: str):
    """Return the class (or a callable with its signature) of the solver ``name``.

    Parameters
    ----------
    name : str
        a key of ``NLP_SOLVERS``, or a name by which Pyomo's ``SolverFactory`` finds an executable that reads NL files:
        ``'pounce'``, ``'asl:ipopt'`` (``'ipopt'`` alone is casadi's), a path

    Raises
    ------
    FesdError
        for a solver that is not installed, with the way to install it
    """
    module, kind, get = NLP_SOLVERS.get(name, EXECUTABLE)
    try:
        kind = getattr(importlib.import_module(f'pyomo_fesd.mpcc.nlp.{module}'), kind)
        reason = kind.missing(name)
    except ImportError as error:
        reason = str(error)
    if reason:
        others = ', '.join(f"'{other}'" for other in NLP_SOLVERS if other != name)
        raise FesdError(f"nlp_solver='{name}'", f"this NLP solver is not available: {reason}", f"{get}; or choose among {others}")
    return kind if name in NLP_SOLVERS else partial(kind, name)


def check_options(name, options, refusal, where='nlp_options'):
    """Raise if the solver refuses the user's options, with the name of the one that it refuses.

    Parameters
    ----------
    refusal : callable dict -> str or None
        the solver's message if it refuses these options
    where : str
        the keyword by which the user gives them
    """
    message = refusal(options) if options else None
    if message is None:
        return
    # some are valid only together, so each one is tried alone only now
    alone = ((key, repr(value), refusal({key: value})) for key, value in options.items())
    together = ', '.join(options), 'this combination', message
    key, shown, message = next((one for one in alone if one[2] is not None), together)
    raise FesdError(
        f"{where}['{key}']",
        f"{name} refuses {shown}: {' '.join(message.split())}",
        f"{where} go to {name} unchanged: take names and values from its documentation",
    )


def accepted(defaults, refusal):
    """Those of our ``defaults`` (dict) that the solver accepts."""
    if refusal(defaults) is None:
        return defaults
    return {key: value for key, value in defaults.items() if refusal({key: value}) is None}


def bound_multipliers(gradient, lbx, ubx):
    """Multipliers of the bounds that make a point stationary, from the gradient of ``f + lam_g g`` there."""
    return np.clip(-gradient, np.where(np.isfinite(lbx), -np.inf, 0.0), np.where(np.isfinite(ubx), np.inf, 0.0))


def rows_with_variables(g, x):
    """Mask over the rows; some solvers do not accept a row without variables."""
    rows = np.zeros(g.numel(), dtype=bool)
    rows[ca.jacobian_sparsity(g, x).row()] = True
    return rows


def violated(g, lbg, ubg):
    """Mask over the rows whose values ``g`` violate their bounds."""
    return (g < lbg - ROW_TOLERANCE) | (g > ubg + ROW_TOLERANCE)


def as_sx(x, p, f, g, derivatives=None):
    """Return an NLP with SX in place of MX, for solvers that need single operations."""
    if isinstance(x, ca.SX):
        return x, p, f, g, derivatives
    nlp = ca.Function('nlp', [x, p], [f, g]).expand()
    x_, p_ = nlp.sx_in()
    if derivatives is not None:
        d, lam = derivatives, (ca.SX.sym('lam_f'), ca.SX.sym('lam_g', g.numel()))
        function = ca.Function('d', [x, p, d.lam_f, d.lam_g], [d.gradient, d.jacobian, d.hessian]).expand()
        derivatives = Derivatives(*function(x_, p_, *lam), *lam)
    return x_, p_, *nlp(x_, p_), derivatives


def lagrangian_gradient(x, p, f, g):
    """Function (x, p, lam_g) -> gradient of ``f + lam_g g`` by x."""
    lam = ca.SX.sym('lam', g.numel())
    return ca.Function('gradient', [x, p, lam], [ca.densify(ca.gradient(f + ca.dot(lam, g), x))])
