"""One case: a problem in one form, from guessed controls; solved, and its controls replayed."""

import importlib
import inspect
import json
import resource
import time

import numpy as np
from benchmarks.hard_ocp import grid, replay

PROBLEMS = ('carts', 'discs', 'hopper', 'ball')
#: Guessed controls of the seeds after the first, as a part of their bounds.
GUESS = 0.1
#: A run ends at its time limit; its process is killed when it has used this multiple of it.
KILL = 1.5
#: Violation and complementarity of a point that counts as a solution on the way.
FEASIBLE = 1e-8


def module(problem):
    """The model file of a problem."""
    return importlib.import_module(f'benchmarks.hard_ocp.{problem}')


def guess(p, seed):
    """Guessed controls (stages, controls); None, for seed 0, means the model's own initial values."""
    if seed == 0:
        return None
    low, high = p.U_RANGE
    return GUESS * np.random.default_rng(seed).uniform(low, high, (p.STAGES, p.CONTROLS))


def initialise(p, m, given):
    """Set the initial values of the controls in the model, and nothing else."""
    ends = grid.ends(p.HORIZON, p.STAGES)[1:]
    for t in m.t:
        stage = int(np.searchsorted(ends, t - 1e-9))
        parts = [m.u[t]] if m.u.dim() == 1 else [m.u[j + 1, t] for j in range(p.CONTROLS)]
        for part, value in zip(parts, given[stage]):
            part.set_value(float(value), skip_validation=True)


def replayed(p, used):
    """What controls cost in the replay, and by how much they miss what the problem asks for; the bounds of the states are imposed
    at points of the grid only, and ``excess`` is by how much the path leaves them between."""
    try:
        out = replay.replay(p.PLANT, p.AT_START, used, np.full(p.STAGES, p.HORIZON / p.STAGES))
    except RuntimeError as error:
        return {'status of replay': str(error)[:80]}
    cost = float(out.cost + p.final_cost(out.q, out.v))
    asked = {'missed': p.missed(out), 'excess': excess(p, out)}
    return {'replayed': cost, **asked, 'impacts': len(out.impacts), 'status of replay': 'ok'}


def excess(p, out):
    """By how much a path leaves the bounds."""
    (low, high, fastest), q, v = p.BOUNDS, np.array(out.positions), np.array(out.velocities)
    return float(max(0.0, (q - high).max(), (low - q).max(), (np.abs(v) - fastest).max()))


def with_pyomo_fesd(p, form, given, options, limit, tee=False):
    """Build and solve; return the row and the controls.

    ``options`` of the model and the grid are known by their names; 'group.name' is an option in a dict of the solver, such as
    'nlp_options.mu_strategy'.
    """
    import pyomo.environ as pyo

    import pyomo_fesd  # noqa: F401

    of_model, of_solver = split(p, form, options)
    started = time.process_time()
    m = p.build(form, **of_model)
    if given is not None:
        initialise(p, m, given)
    built = time.process_time()
    results = pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit, tee=tee, **of_solver)
    return {
        'status': str(results.solver.termination_condition),
        'certified': str(results.solver.stationarity) == 'B',
        'objective': pyo.value(m.cost),
        'residual': results.solver.complementarity,
        'iterations': int(results.solver.nlp_iterations),
        'nlps': int(results.solver.nlps),
        'build': built - started,
        'cpu': time.process_time() - started,
        'better': better_points(results.solver.steps, built - started, time.process_time() - started),
    }, p.controls(m)


def better_points(steps, begin, end):
    """Points of branches that are better than all before, as ``seconds:objective`` with blanks between.

    ``begin`` and ``end`` of the solve are CPU seconds; those between are in proportion to the seconds of the log.
    """
    found, best, passed, total = [], np.inf, 0.0, sum(step.seconds for step in steps)
    for step in steps:
        passed += step.seconds
        if step.kind == 'branch' and max(step.violation, step.complementarity) <= FEASIBLE and step.f < best:
            best = step.f
            found.append(f'{begin + (end - begin) * passed / total:.4g}:{best:.6g}')
    return ' '.join(found)


def split(p, form, options):
    """Options of the model and its grid, and those of the solver."""
    from pyomo_fesd.finite_elements.options import OPTIONS

    own = {*inspect.signature(p.FORMS[form]).parameters, *inspect.signature(grid.moving_grid).parameters, *OPTIONS}
    of_model, of_solver = {}, {}
    for name, value in options.items():
        if name in own:
            of_model[name] = value
        elif '.' in name:
            group, _, inner = name.partition('.')
            of_solver.setdefault(group, {})[inner] = value
        else:
            of_solver[name] = value
    return of_model, of_solver


def with_nosnoc(p, given):
    """Solve the twin with the settings of nosnoc's example; return the row and the controls."""
    from benchmarks.hard_ocp import nosnoc_peer

    row = nosnoc_peer.solve(p, given)
    return row, row.pop('u')


def measure(problem, method, seed, options, limit, tee=False):
    """Solve one case and replay its controls; a dict."""
    p = module(problem)
    given, started = guess(p, seed), time.perf_counter()
    try:
        if method == 'nosnoc':
            found, used = with_nosnoc(p, given)
        else:
            found, used = with_pyomo_fesd(p, method, given, options, limit, tee)
    except Exception as error:
        return {'status': f'{type(error).__name__}: {error}'[:100]}
    return found | {'seconds': time.perf_counter() - started} | replayed(p, used)


def print_case(problem, method, seed, options, limit, tee=False):
    """Print one case as a line of JSON, in a process that dies some time after its limit."""
    resource.setrlimit(resource.RLIMIT_CPU, (int(KILL * limit) + 30,) * 2)
    row = measure(problem, method, seed, options, limit, tee)
    print(json.dumps({'problem': problem, 'method': method, 'seed': seed} | row, default=float), flush=True)
