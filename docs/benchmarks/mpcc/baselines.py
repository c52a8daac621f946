"""Plain methods for MPCCs to compare ``mpec_hybrid`` with, on the same compiled functions and with the same Ipopt settings.

    scholtes   min f             s.t.  G, H >= 0,  G_i H_i <= eps    eps = 1, 0.1, ... 1e-9
    l1         min f + rho G'H   s.t.  G, H >= 0                     rho = 1, 10, ... 1e9
    product    min f             s.t.  G, H >= 0,  G_i H_i <= 0      one NLP

Each NLP starts from the primal point of the one before, also after a failure.  A homotopy ends at its first point that is feasible
and complementary; otherwise its answer is the best point of all.
"""

import time
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.nlp.solver import IPOPT

OPTIONS = IPOPT | {'tol': 1e-8, 'max_iter': 3000}
#: A homotopy ends at a point with this scaled violation and scaled complementarity.
FEASIBLE, COMPLEMENTARY = 1e-6, 1e-8
#: Values of the parameter of each method.
HOMOTOPIES = {
    'scholtes': [10.0**-k for k in range(10)],
    'l1': [10.0**k for k in range(10)],
    'product': [0.0],
}


@dataclass
class Answer:
    """Result of a method: the point, Ipopt's status there, the work.

    ``seconds`` (wall) and ``cpu`` count nlpsol's construction and the NLPs.
    """

    w: np.ndarray
    status: str = ''
    nlps: int = 0
    iterations: int = 0
    last: float = np.nan
    seconds: float = 0.0
    cpu: float = 0.0
    residuals: tuple = field(default=(np.inf, np.inf), repr=False)


class _Deadline(ca.Callback):
    """Callback that stops Ipopt at the time limit."""

    def __init__(self, n, m):
        super().__init__()
        self._length, self.until = {'x': n, 'lam_x': n, 'f': 1, 'g': m, 'lam_g': m, 'lam_p': 1}, np.inf
        self.construct('deadline', {})

    def get_n_in(self):
        return ca.nlpsol_n_out()

    def get_n_out(self):
        return 1

    def get_sparsity_in(self, i):
        return ca.Sparsity.dense(self._length[ca.nlpsol_out(i)], 1)

    def eval(self, arg):
        return [float(time.perf_counter() > self.until)]


def solve(method, c, judge, limit):
    """Run a method on a compiled MPCC.

    Parameters
    ----------
    c : Compiled
        compiled functions of the MPCC
    judge : callable w -> (violation, complementarity), both scaled
        its time does not count
    limit : float, seconds
    """
    started, cpu = time.perf_counter(), time.process_time()
    solver, bounds, deadline = _build(method, c)
    answer, w = Answer(c.x0, seconds=time.perf_counter() - started, cpu=time.process_time() - cpu), c.x0
    for parameter in HOMOTOPIES[method]:
        if answer.seconds > limit:
            break
        started, cpu = time.perf_counter(), time.process_time()
        deadline.until = started + limit - answer.seconds
        result = solver(x0=w, p=parameter, **bounds)
        answer.seconds, answer.cpu = answer.seconds + time.perf_counter() - started, answer.cpu + time.process_time() - cpu
        stats, found = solver.stats(), np.asarray(result['x'], dtype=float).ravel()
        answer.nlps, answer.iterations = answer.nlps + 1, answer.iterations + int(stats['iter_count'])
        answer.last = parameter
        if not np.all(np.isfinite(found)):
            continue
        w, residuals = found, judge(found)
        if not answer.status or max(residuals) <= max(answer.residuals):
            answer.w, answer.status, answer.residuals = w, stats['return_status'], residuals
        if stats['success'] and residuals[0] <= FEASIBLE and residuals[1] <= COMPLEMENTARY:
            break
    return answer


def _build(method, c):
    """The NLP solver, its bounds and its deadline."""
    p, products = ca.SX.sym('p'), c.G * c.H
    sides = _sides(c)
    if method == 'l1':
        f, last = c.f + p * ca.sum1(products), ca.SX(0, 1)
    else:
        f, last = c.f, products - p
    g = ca.vertcat(c.g, sides, last)
    bounds = {
        'lbx': c.lbx,
        'ubx': c.ubx,
        'lbg': np.concatenate([c.lbg, np.zeros(sides.numel()), np.full(last.numel(), -np.inf)]),
        'ubg': np.concatenate([c.ubg, np.full(sides.numel(), np.inf), np.zeros(last.numel())]),
    }
    deadline = _Deadline(c.x.numel(), g.numel())
    settings = {'print_time': False, 'ipopt': OPTIONS, 'iteration_callback': deadline}
    return ca.nlpsol(method, 'ipopt', {'x': c.x, 'p': p, 'f': f, 'g': g}, settings), bounds, deadline


def _sides(c):
    """The distinct sides except variables (their bounds hold already) and constants."""
    sides = ca.vertcat(c.G, c.H)
    _, first = np.unique(c.side_of, return_index=True)
    rows = [sides[int(i)] for i in sorted(first) if not (sides[int(i)].is_symbolic() or sides[int(i)].is_constant())]
    return ca.vertcat(*rows) if rows else ca.SX(0, 1)
