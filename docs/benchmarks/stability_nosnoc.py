"""The twin of a :class:`~stability_systems.System` for the PyPI package nosnoc 0.2.0, at its default options."""

import contextlib
import io
from copy import deepcopy

import casadi as ca
import numpy as np
from nosnoc import IrkSchemes, NosnocModel, NosnocOcp, NosnocOpts, NosnocSolver
from nosnoc.nosnoc_types import InitializationStrategy, Status

SCHEMES = {'LAGRANGE-RADAU': IrkSchemes.RADAU_IIA, 'LAGRANGE-LEGENDRE': IrkSchemes.GAUSS_LEGENDRE}


def states(system):
    """The neutral system as nosnoc's model and optimal control problem."""
    x, u = ca.SX.sym('x', len(system.x0)), ca.SX.sym('u', 1 if system.u else 0)
    xs, us = [x[i] for i in range(x.shape[0])], u if system.u else 0.0
    stage = ca.SX.sym('stage') if system.free else None
    F, c, S = [], [], []
    for k, part in enumerate(system.parts):
        columns = [ca.vertcat(*rates(xs, us, ca)) for _, rates in part.modes]
        if system.smooth and k == 0:
            columns = [column + ca.vertcat(*system.smooth(xs, us, ca)) for column in columns]
        F.append(ca.horzcat(*columns))
        c.append(ca.vertcat(*part.c(xs, ca)))
        S.append(np.array([signs for signs, _ in part.modes]))
    return x, u, xs, us, stage, F, c, S


def solve(system, nfe, ncp, scheme):
    """``(says solved, states at the end, what it printed besides)``."""
    x, u, xs, us, _, F, c, S = states(system)
    model = NosnocModel(x=x, x0=np.array(system.x0, dtype=float), F=F, c=c, S=S, u=u)
    keywords = {}
    if system.u:
        keywords |= {'lbu': np.array([system.u[0]]), 'ubu': np.array([system.u[1]]), 'u_guess': np.array([system.u[2]])}
    if system.final:
        keywords['f_terminal'] = system.final(xs, ca)
    if system.target:
        keywords['g_terminal'] = ca.vertcat(*system.target(xs, ca))
    return _run(system, model, NosnocOcp(**keywords) if keywords else None, nfe, ncp, scheme)


def _stages(system):
    lengths = np.diff([0, *system.stages, system.end])
    if np.ptp(lengths) > 1e-9 * system.end:
        raise NotImplementedError('its control stages are of equal length')
    return len(lengths)


def solve_free(system, nfe, ncp, scheme):
    """The same where the first state is free at time 0: a stage before it, in which a control moves that state there.

    nosnoc takes the initial state as given, so another stage of the same length is put before, with the rates of the system
    switched off by a parameter that differs from stage to stage.
    """
    if not system.final:
        # the twin below is our work-around; that it does not solve this may be its own fault
        raise NotImplementedError('its initial state is given')
    x, u, xs, us, on, F, c, S = states(system)
    move = ca.SX.sym('move')
    shift = ca.vertcat(move / system.end, *[0] * (len(xs) - 1))
    F = [on * f + (1 - on) * ca.repmat(shift if k == 0 else 0 * shift, 1, f.shape[1]) for k, f in enumerate(F)]
    model = NosnocModel(
        x=x,
        x0=np.array(system.x0, dtype=float),
        F=F,
        c=c,
        S=S,
        u=move,
        p_time_var=on,
        p_time_var_val=np.array([[0.0], [1.0]]),
    )
    keywords = {'lbu': np.array([system.free[0] - system.x0[0]]), 'ubu': np.array([system.free[1] - system.x0[0]])}
    if system.final:
        keywords['f_terminal'] = system.final(xs, ca)
    if system.target:
        keywords['g_terminal'] = ca.vertcat(*system.target(xs, ca))
    return _run(system, model, NosnocOcp(**keywords), nfe, ncp, scheme, before=1)


def _run(system, model, ocp, nfe, ncp, scheme, before=0):
    stages = _stages(system) + before
    options = NosnocOpts(
        terminal_time=system.end * (1 + before),
        N_stages=stages,
        N_finite_elements=nfe if before else max(1, nfe // stages),
        n_s=ncp,
        irk_scheme=SCHEMES[scheme],
        print_level=0,
    )
    # a dict shared by all instances, into which the tolerance is written
    options.opts_casadi_nlp = deepcopy(NosnocOpts.opts_casadi_nlp)
    if system.guess:
        options.initialization_strategy = InitializationStrategy.EXTERNAL
    with contextlib.redirect_stdout(io.StringIO()) as said:
        solver = NosnocSolver(options, model, ocp) if ocp else NosnocSolver(options, model)
        if system.guess:
            solver.set('x', np.tile(np.array(system.guess, dtype=float), (stages * options.N_finite_elements, 1)))
        results = solver.solve()
    solved = results['status'] is Status.SUCCESS
    # the steps before the last may have failed, which it prints only
    told = '' if 'Warning' not in said.getvalue() else 'a step before the last failed'
    found = np.array(results['x_out']).ravel()
    return solved, [float(v) for v in found], told
