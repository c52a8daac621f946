"""The twin of a ``System`` in nosnoc 0.2.0, at its default options."""

import contextlib
import io

import casadi as ca
import numpy as np
from benchmarks.common.nosnoc_peer import options
from nosnoc import NosnocModel, NosnocOcp, NosnocSolver
from nosnoc.nosnoc_types import InitializationStrategy, Status


def solve(system, nfe, ncp, scheme):
    """Solve at the defaults; return ``(claims success, states at the end, warnings)``."""
    x, u = ca.SX.sym('x', len(system.x0)), ca.SX.sym('u', 1 if system.u else 0)
    xs = ca.vertsplit(x)
    F, c, S = _filippov(system, xs, u if system.u else 0.0)
    given = {'x': x, 'x0': np.array(system.x0, dtype=float), 'c': c, 'S': S}
    if system.free:
        model = NosnocModel(**given, **_free_start(system, F))
    else:
        model = NosnocModel(**given, F=F, u=u)
    bounds = _bounds(system, xs)
    return _run(system, model, NosnocOcp(**bounds) if bounds else None, nfe, ncp, scheme)


def _filippov(system, xs, u):
    """Modes F, switching functions c and sign patterns S of all parts."""
    F, c, S = [], [], []
    for k, part in enumerate(system.parts):
        columns = [ca.vertcat(*rates(xs, u, ca)) for _, rates in part.modes]
        if system.smooth and k == 0:
            columns = [column + ca.vertcat(*system.smooth(xs, u, ca)) for column in columns]
        F.append(ca.horzcat(*columns))
        c.append(ca.vertcat(*part.c(xs, ca)))
        S.append(np.array([signs for signs, _ in part.modes]))
    return F, c, S


def _free_start(system, F):
    """Modes, control and parameter of a model whose first state is free at time 0.

    nosnoc takes the initial state as given, so a control stage of the same length is put before, in which a control shifts that
    state and a parameter that differs from stage to stage switches off the rates of the system.
    """
    if not system.final:
        # this twin is our own work-around, whose failure would not be nosnoc's
        raise NotImplementedError('its initial state is given')
    shift, on = ca.SX.sym('shift'), ca.SX.sym('on')
    rates = ca.vertcat(shift / system.end, *[0] * (len(system.x0) - 1))
    F = [on * f + (1 - on) * ca.repmat(rates if k == 0 else 0 * rates, 1, f.shape[1]) for k, f in enumerate(F)]
    return {'F': F, 'u': shift, 'p_time_var': on, 'p_time_var_val': np.array([[0.0], [1.0]])}


def _bounds(system, xs):
    """Bounds of the control, objective and target."""
    keywords = {}
    if system.free:
        keywords |= {'lbu': np.array([system.free[0] - system.x0[0]]), 'ubu': np.array([system.free[1] - system.x0[0]])}
    elif system.u:
        keywords |= {'lbu': np.array([system.u[0]]), 'ubu': np.array([system.u[1]]), 'u_guess': np.array([system.u[2]])}
    if system.final:
        keywords['f_terminal'] = system.final(xs, ca)
    if system.target:
        keywords['g_terminal'] = ca.vertcat(*system.target(xs, ca))
    return keywords


def _stages(system):
    lengths = np.diff([0, *system.stages, system.end])
    if np.ptp(lengths) > 1e-9 * system.end:
        raise NotImplementedError('its control stages are of equal length')
    return len(lengths)


def _run(system, model, ocp, nfe, ncp, scheme):
    before = 1 if system.free else 0
    stages = _stages(system) + before
    settings = options(
        scheme,
        terminal_time=system.end * (1 + before),
        N_stages=stages,
        N_finite_elements=nfe if before else max(1, nfe // stages),
        n_s=ncp,
        print_level=0,
    )
    if system.guess:
        settings.initialization_strategy = InitializationStrategy.EXTERNAL
    with contextlib.redirect_stdout(io.StringIO()) as said:
        solver = NosnocSolver(settings, model, ocp) if ocp else NosnocSolver(settings, model)
        if system.guess:
            solver.set('x', np.tile(np.array(system.guess, dtype=float), (stages * settings.N_finite_elements, 1)))
        results = solver.solve()
    # nosnoc only prints failures of steps before the last one
    warning = 'a step before the last failed' if 'Warning' in said.getvalue() else ''
    return results['status'] is Status.SUCCESS, [float(v) for v in np.array(results['x_out']).ravel()], warning
