"""What the twins of the optimal control problems in nosnoc 0.2.0 share: its options, its times, and the plain objective.

nosnoc adds a penalty on the element lengths to the objective that it reports; the objective here is the problem's own, by the
quadrature of the scheme.
"""

from copy import deepcopy
from time import perf_counter

import numpy as np
from nosnoc import IrkSchemes, NosnocOpts, NosnocSolver

SCHEMES = {'RADAU': IrkSchemes.RADAU_IIA, 'GAUSS': IrkSchemes.GAUSS_LEGENDRE}


def options(horizon, stages, elements, ncp, scheme='RADAU', **settings):
    """nosnoc's defaults for ``stages`` control stages of ``elements`` elements of ``ncp`` points, except for ``settings``.

    Options of Ipopt stand in a dict that all instances share, hence the copy.
    """
    opts = NosnocOpts(terminal_time=horizon, N_stages=stages, N_finite_elements=elements, n_s=ncp, irk_scheme=SCHEMES[scheme])
    opts.opts_casadi_nlp = deepcopy(NosnocOpts.opts_casadi_nlp)
    for name, value in settings.items():
        setattr(opts, name, value)
    return opts


def solve(model, ocp, opts, u=None, w=None):
    """Build and solve; ``u`` is a start of the controls, stage by stage.

    Returns a dict: ``build`` and ``solve`` in s, ``iterations`` over the ``nlps``, ``objective``, ``status`` as nosnoc reports it
    (that of the last NLP), ``residual`` of complementarity, ``x_end``, and the controls ``u`` by stage.
    """
    started = perf_counter()
    solver = NosnocSolver(opts, model, ocp)
    if u is not None:
        solver.set('u', np.reshape(u, np.shape(solver.problem.ind_u)))
    built = perf_counter()
    results = solver.solve()
    solved = perf_counter()
    iterations = [n for n in results['nlp_iter'] if n is not None]
    problem, w = solver.problem, results['w_sol']
    return {
        'build': built - started,
        'solve': solved - built,
        'nlps': len(iterations),
        'iterations': sum(iterations),
        'objective': objective(problem, w),
        'residual': float(problem.comp_res(w, solver.p_val)),
        'status': results['status'].name,
        'x_end': results['x_out'],
        'u': np.array(results['u_list']),
        'h': np.array(results['time_steps']),
    }


def objective(problem, w):
    """The objective of the problem, without the penalty on the element lengths."""
    model, ocp, opts = problem.model, problem.ocp, problem.opts
    v, lengths, total = w[problem.ind_v_global], iter(w[problem.ind_h]), 0.0
    for i, stage in enumerate(problem.ind_x):
        p = model.p_val_ctrl_stages[i]
        for points in stage:
            rates = [float(ocp.f_q_fun(w[points[k]], w[problem.ind_u[i]], p, v)) for k in range(opts.n_s)]
            total += next(lengths) * np.dot(np.ravel(opts.B_irk)[1:], rates)
    return total + float(ocp.f_q_T_fun(w[problem.ind_x[-1][-1][-1]], model.p_val_ctrl_stages[-1], v))
