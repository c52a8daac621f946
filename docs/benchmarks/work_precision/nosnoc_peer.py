"""The systems of the study in nosnoc 0.2.0, as one problem or step by step.

The initial state is data in nosnoc.  Where it is free, a control stage of one element is put before, in which a control shifts the
first state and all other rates are zero.
"""

from time import perf_counter

import casadi as ca
import numpy as np
from benchmarks.common.nosnoc_peer import options, work
from benchmarks.work_precision.models import ControlModel
from benchmarks.work_precision.systems import Found, reached
from nosnoc import NosnocModel, NosnocOcp, NosnocSimLooper, NosnocSolver

#: Elements of one step; nosnoc's default.
PER_STEP = 2


def nosnoc(problem, K, N, scheme, tolerance=None, by_steps=False, **_):
    """Solve at the defaults or with another tolerance; all elements at once, or one problem for every two elements."""
    if isinstance(problem, ControlModel):
        return _control(problem, K, N, scheme, tolerance)
    started, system = perf_counter(), problem.system
    settings = options(scheme, tolerance, n_s=K, print_level=0, **_grid(system, N, by_steps))
    solver = NosnocSolver(settings, *_problem(system))
    built = perf_counter()
    return (_by_steps if by_steps else _at_once)(solver, system, N, started, built)


def _control(problem, K, N, scheme, tolerance):
    """Solve by the twin in the problem's module."""
    settings = {} if tolerance is None else {'tolerance': tolerance}
    run = problem.module.with_nosnoc(elements=N // problem.module.STAGES, ncp=K, scheme=scheme, **settings)
    found = Found(run['status'], run['status'] == 'SUCCESS', run['build'], run['solve'], objective=run['objective'])
    found.iterations, found.nlps = run['iterations'], run['nlps']
    return found


def _grid(system, N, by_steps):
    """Horizon, stages and elements."""
    if by_steps:
        return {'terminal_time': system.horizon * PER_STEP / N, 'N_finite_elements': PER_STEP}
    if system.free_start:
        return {'terminal_time': 2 * system.horizon, 'N_stages': 2, 'Nfe_list': [1, N]}
    stages = system.control.stages if system.control else 1
    return {'terminal_time': system.horizon, 'N_stages': stages, 'N_finite_elements': N // stages}


def _problem(system):
    """Model and, for a problem with degrees of freedom, its objective and bounds."""
    x = ca.SX.sym('x', len(system.x0))
    u = ca.SX.sym('u', 0 if system.simulation else 1)
    state = ca.vertsplit(x)
    modes = [ca.vertcat(*side(state, u)) for side in (system.above, system.below)]
    rest = {} if system.simulation else {'u': u}
    if system.free_start:
        on = ca.SX.sym('on')
        shift = ca.vertcat(u, *[0] * (len(state) - 1))
        modes = [on * mode + (1 - on) * shift for mode in modes]
        rest |= {'p_time_var': on, 'p_time_var_val': np.array([[0.0], [1.0]])}
    model = NosnocModel(
        x=x, x0=np.array(system.x0), F=[ca.horzcat(*modes)], c=[system.switching(state)], S=[np.array([[1], [-1]])], **rest
    )
    if system.simulation:
        return (model,)
    return model, NosnocOcp(f_terminal=system.objective(state), **_bounds(system))


def _bounds(system):
    if system.control:
        lower, upper, guess, _ = system.control
    else:
        lower, upper, guess = *((end - system.x0[0]) / system.horizon for end in system.free_start), 0.0
    return {'lbu': np.array([lower]), 'ubu': np.array([upper]), 'u_guess': np.array([guess])}


def _at_once(solver, system, N, started, built):
    results = solver.solve()
    solved = perf_counter()
    status = results['status'].name
    found = Found(status, status == 'SUCCESS', built - started, solved - built, **work(results))
    found.state = list(results['x_out'])
    times, boundaries = results['t_grid'], [system.x0, *results['x_list']]
    if system.free_start:
        times, boundaries = times[1:] - system.horizon, boundaries[1:]
        found.x0 = boundaries[0][0]
    if system.control:
        found.control = [float(u[0]) for u in results['u_list']]
    if system.objective is not None:
        found.objective = float(system.objective(found.state))
    found.switch = reached(times, [system.switching(x) for x in boundaries])
    return found


def _by_steps(solver, system, N, started, built):
    loop = NosnocSimLooper(solver, np.array(system.x0), N // PER_STEP)
    loop.run()
    solved = perf_counter()
    results = loop.get_results()
    failed = sum(status.name != 'SUCCESS' for status in results['status'])
    found = Found(f'{failed} steps failed' if failed else 'SUCCESS', not failed, built - started, solved - built)
    found.state = list(loop.xcurrent)
    found.switch = reached(results['t_grid'], [system.switching(x) for x in results['X_sim']])
    return found
