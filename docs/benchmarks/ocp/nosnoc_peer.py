"""Helpers of the twins in nosnoc 0.2.0: options, times, and the plain objective.

nosnoc adds a penalty on the element lengths to the objective that it reports; the objective here is the problem's own, by the
quadrature of the scheme.
"""

from time import perf_counter, process_time

import numpy as np
from benchmarks.common import nosnoc_peer
from nosnoc import NosnocSolver


def options(horizon, stages, elements, ncp, scheme='RADAU', **settings):
    """nosnoc's options for ``stages`` control stages of ``elements`` elements of ``ncp`` points; see ``common.nosnoc_peer``."""
    return nosnoc_peer.options(scheme, terminal_time=horizon, N_stages=stages, N_finite_elements=elements, n_s=ncp, **settings)


def solve(model, ocp, opts, u=None):
    """Build and solve; ``u`` holds initial values of the controls by stage.

    Returns a dict: ``build`` and ``solve`` in s, ``cpu`` of both, ``iterations`` over the ``nlps``, ``objective``, ``status`` as
    nosnoc reports it (that of the last NLP), ``residual`` of complementarity, ``x_end``, the states ``x`` at the ends of the
    elements, the controls ``u`` by stage and the element lengths ``h``.
    """
    started, cpu = perf_counter(), process_time()
    solver = NosnocSolver(opts, model, ocp)
    if u is not None:
        solver.set('u', np.reshape(u, np.shape(solver.problem.ind_u)))
    built = perf_counter()
    results = solver.solve()
    solved, cpu = perf_counter(), process_time() - cpu
    problem, w = solver.problem, results['w_sol']
    return {
        'build': built - started,
        'solve': solved - built,
        'cpu': cpu,
        'objective': objective(problem, w),
        'residual': float(problem.comp_res(w, solver.p_val)),
        'status': results['status'].name,
        'x_end': results['x_out'],
        'x': results['x_list'],
        'u': np.array(results['u_list']),
        'h': np.array(results['time_steps']),
    } | nosnoc_peer.work(results)


def objective(problem, w):
    """The objective of the problem without the penalty on the element lengths."""
    model, ocp, opts = problem.model, problem.ocp, problem.opts
    v, lengths, total = w[problem.ind_v_global], iter(w[problem.ind_h]), 0.0
    for i, stage in enumerate(problem.ind_x):
        p = model.p_val_ctrl_stages[i]
        for points in stage:
            rates = [float(ocp.f_q_fun(w[points[k]], w[problem.ind_u[i]], p, v)) for k in range(opts.n_s)]
            total += next(lengths) * np.dot(np.ravel(opts.B_irk)[1:], rates)
    return total + float(ocp.f_q_T_fun(w[problem.ind_x[-1][-1][-1]], model.p_val_ctrl_stages[-1], v))
