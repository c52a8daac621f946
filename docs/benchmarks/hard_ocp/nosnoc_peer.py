"""Helpers of the twins in nosnoc 0.2.0, which states impacts by time-freezing, written by hand as in its own examples.

The clock is the last state, and the speed of time the last control.  The running cost of nosnoc cannot depend on the mode, so it
counts frozen time too: the objective of a twin is larger than the cost of its controls.
"""

from dataclasses import dataclass, field
from time import process_time

import casadi as ca
import numpy as np
from benchmarks.common import nosnoc_peer
from benchmarks.ocp.nosnoc_peer import objective
from nosnoc import CrossComplementarityMode, NosnocModel, NosnocOcp, NosnocSolver, PssMode, StepEquilibrationMode

#: What the examples of nosnoc with time-freezing have in common.
SETTINGS = {
    'pss_mode': PssMode.STEP,
    'cross_comp_mode': CrossComplementarityMode.COMPLEMENT_ALL_STAGE_VALUES_WITH_EACH_OTHER,
    'step_equilibration': StepEquilibrationMode.HEURISTIC_MEAN,
    'time_freezing': True,
}


def symbols(n, controls):
    """q (n), v (n), the clock, u and the speed of time."""
    return ca.SX.sym('q', n), ca.SX.sym('v', n), ca.SX.sym('t'), ca.SX.sym('u', controls), ca.SX.sym('speed')


@dataclass
class Twin:
    """A problem in nosnoc.

    ``model`` and ``costs`` are arguments of ``NosnocModel`` and ``NosnocOcp``; ``bounds`` are the lowest and highest states without
    the clock, and those of the speed of time; ``settings`` and ``ipopt`` options of nosnoc and of Ipopt.
    """

    model: dict
    bounds: tuple
    costs: dict
    settings: dict = field(default_factory=dict)
    ipopt: dict = field(default_factory=dict)


def solve(p, guess):
    """Build and solve the twin of the problem file ``p`` from guessed controls (stages, controls), or None."""
    started = process_time()
    twin = p.twin()
    low, high, (slowest, fastest) = twin.bounds
    limit = np.full(p.CONTROLS, p.U_MAX)
    ocp = NosnocOcp(
        lbu=np.append(-limit, slowest),
        ubu=np.append(limit, fastest),
        u_guess=np.append(0 * limit, 1.0),
        lbx=np.append(low, -np.inf),
        ubx=np.append(high, np.inf),
        **twin.costs,
    )
    stages = {'terminal_time': p.HORIZON, 'N_stages': p.STAGES, 'N_finite_elements': p.ELEMENTS, 'n_s': p.NCP}
    opts = nosnoc_peer.options('RADAU', **SETTINGS | stages | twin.settings)
    opts.opts_casadi_nlp['ipopt'].update(twin.ipopt)
    solver = NosnocSolver(opts, NosnocModel(x0=np.concatenate([*p.AT_START, [0.0]]), **twin.model), ocp)
    if guess is not None:
        solver.set('u', np.column_stack([guess, np.ones(p.STAGES)]))
    built = process_time()
    results = solver.solve()
    return {
        'status': results['status'].name,
        'certified': '',
        'objective': float(objective(solver.problem, results['w_sol'])),
        'build': built - started,
        'cpu': process_time() - started,
        'residual': float(solver.problem.comp_res(results['w_sol'], solver.p_val)),
        'u': np.array(results['u_list'])[:, : p.CONTROLS],
    } | nosnoc_peer.work(results)
