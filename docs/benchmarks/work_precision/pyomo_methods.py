"""Methods that solve a Pyomo model: this package; and on a fixed grid complementarity conditions, smoothing and big-M.

Each takes a problem of ``models`` and its settings, and returns a ``Found``.
"""

import time

import highspy
import pyomo.environ as pyo
from benchmarks.work_precision.models import SCHEMES, SystemModel, smooth, state
from benchmarks.work_precision.systems import Found, reached
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.fbbt.fbbt import compute_bounds_on_expr
from pyomo.contrib.solver.common.factory import SolverFactory

import pyomo_fesd

#: Share of a mode for the value c of its switching function and a width w.
WEIGHTS = {
    'tanh': lambda c, w: (1 + pyo.tanh(c / w)) / 2,
    'sqrt': lambda c, w: (1 + c / pyo.sqrt(c**2 + w**2)) / 2,
}
PHASES = ('relaxation', 'branch', 'lpec')


def mpec_hybrid(problem, K, N, scheme, limit, **_):
    """``mpec_hybrid`` on moving elements."""
    started = time.perf_counter()
    m = problem.moving(K, N, scheme)
    return _with_switch(_solved(problem, m, started, limit), m)


def simulate(problem, K, N, scheme, limit, **_):
    """``simulate``, without elements on the model."""
    started = time.perf_counter()
    m = problem.transformed()
    built = time.perf_counter()
    try:
        frame = pyomo_fesd.simulate(m, nfe=N, ncp=K, scheme=SCHEMES[scheme], time_limit=limit)
    except pyomo_fesd.FesdError as error:
        return Found(str(error)[:100], False, built - started, time.perf_counter() - built)
    found = Found('simulated', True, built - started, time.perf_counter() - built)
    problem.read(found, m)
    return _with_switch(found, frame)


def refine(problem, K, scheme, width, limit, **_):
    """``refine`` to the tolerance ``width``."""
    started = time.perf_counter()
    m = problem.transformed()
    built = time.perf_counter()
    reached_it = pyomo_fesd.refine(m, width, ncp=K, scheme=SCHEMES[scheme], time_limit=limit).reached
    found = Found('reached' if reached_it else 'not reached', reached_it, built - started, time.perf_counter() - built)
    problem.read(found, m)
    return _with_switch(found, m)


def fixed_grid(problem, K, N, scheme, limit, **_):
    """Complementarity conditions at each collocation point of equal elements, by ``mpec_hybrid``."""
    started = time.perf_counter()
    m = problem.fixed(K, N, scheme)
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    return _on_the_grid(problem, _solved(problem, m, started, limit), m)


def smoothing(problem, K, N, scheme, limit, width, shape):
    """A smoothed step of finite width instead of modes."""
    started = time.perf_counter()
    m = smooth(problem.fixed(K, N, scheme), lambda c: WEIGHTS[shape](c, width))
    return _on_the_grid(problem, _solved(problem, m, started, limit), m)


def big_m(problem, K, N, scheme, limit, **_):
    """Binaries at each collocation point, by HiGHS; for systems with a linear form."""
    started = time.perf_counter()
    problem = SystemModel(problem.system.linear or problem.system)
    m = _bound_rates(problem.fixed(K, N, scheme), problem.system)
    pyo.TransformationFactory('gdp.bigm').apply_to(m)
    m.constant = pyo.Objective(expr=0)
    # HiGHS refuses a run with another number of threads than the last one of this thread, which may have had its default
    highspy.Highs.resetGlobalScheduler(True)
    built = time.perf_counter()
    results = SolverFactory('highs').solve(
        m, time_limit=limit, threads=1, raise_exception_on_nonoptimal_result=False, load_solutions=False
    )
    solved = time.perf_counter()
    status = results.termination_condition.name
    found = Found(status, status == 'convergenceCriteriaSatisfied', built - started, solved - built)
    if results.incumbent_objective is None:
        return found
    results.solution_loader.load_vars()
    problem.read(found, m)
    return _on_the_grid(problem, found, m)


def _bound_rates(m, system):
    """Derive bounds of the derivatives from those of the states, for big-M."""
    free = pyo.ConcreteModel()
    free.x = pyo.Var(m.i, bounds=lambda b, i: system.bounds[i])
    x = list(free.x.values())
    for i in m.i:
        low, high = zip(*(compute_bounds_on_expr(side(x, None)[i] + 0 * x[i]) for side in (system.above, system.below)))
        for dx in m.dx[:, i]:
            dx.setlb(min(low))
            dx.setub(max(high))
    return m


# Solving and reading


def _solved(problem, m, started, limit):
    """Solve by ``mpec_hybrid``; compilation counts as building, as in other tools."""
    timer = HierarchicalTimer()
    try:
        results = SolverFactory('mpec_hybrid').solve(
            m, timer=timer, time_limit=limit, raise_exception_on_nonoptimal_result=False, load_solutions=False
        )
    except pyomo_fesd.FesdError as error:
        return Found(str(error)[:100], False, time.perf_counter() - started, 0.0)
    if results.incumbent_objective is not None or results.extra_info.stationarity is not None:
        results.solution_loader.load_vars()
    total = time.perf_counter() - started
    solve = sum(timer.get_total_time(phase) for phase in PHASES if phase in timer.timers)
    info = results.extra_info
    certified = str(info.stationarity) == 'B'
    found = Found('certified' if certified else str(info.outcome), certified, total - solve, solve)
    found.iterations, found.nlps = info.nlp_iterations, info.nlps
    problem.read(found, m)
    return found


def _with_switch(found, solved):
    """Add the time of the first switch of a model, or of a trajectory."""
    if found.state is not None:
        found.switch = next((s.time for s in pyomo_fesd.switches(solved)), None)
    return found


def _on_the_grid(problem, found, m):
    """Add the time of the switch on a fixed grid, from the values at all points."""
    if found.state is not None:
        c = problem.system.switching
        times = [t for t in m.t if all(x.value is not None for x in state(m, t))]
        found.switch = reached(times, [pyo.value(c(state(m, t))) for t in times])
    return found
