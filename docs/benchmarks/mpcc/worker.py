"""One instance by one method, in a child process of ``run.py``: its row."""

import gc
import re
import time
from functools import lru_cache
from pathlib import Path

import numpy as np
import pyomo.environ as pyo
from benchmarks.common.processes import silence_output
from benchmarks.mpcc import b_stationarity, baselines
from benchmarks.mpcc.instance import Instance
from pyomo.common.collections import ComponentMap
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.mpec import Complementarity, complements

import pyomo_fesd  # noqa: F401  registers mpec_hybrid
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc

METHODS = ('hybrid', *baselines.HOMOTOPIES)
PHASES = ('compile', 'build', 'relaxation', 'branch', 'lpec')
COLUMNS = f"""
set instance method n rows pairs sense best_known
status certified solved b_stationary
time total {' '.join(PHASES)}
nlps iterations lpecs binaries eps_last
violation complementarity objective gap lpec_value lpec_binaries moved
error
""".split()
#: A point is solved when both residuals of the instance's reader are below this.
SOLVED = 1e-6


def serve(pipe):
    """Answer each (path, method, limit) with two rows: first that of the run, then the same with the check of B-stationarity."""
    silence_output()
    _warm_up()
    pipe.send('ready')
    while True:
        path, method, limit = pipe.recv()
        row, x = _run(path, method, limit)
        pipe.send(row)
        pipe.send(row | _check(path, x) if row.get('solved') else row)


def _warm_up():
    """Load the modules that a first solve imports: their time belongs to no instance, nor do later searches for garbage."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var([0, 1], bounds=(0, None), initialize=1)
    m.pair = Complementarity(expr=complements(0 <= m.x[0], m.x[1] >= 0))
    m.cost = pyo.Objective(expr=(m.x[0] - 1) ** 2 + (m.x[1] - 2) ** 2)
    SolverFactory('mpec_hybrid').solve(m)
    gc.collect()
    gc.freeze()


def _run(path, method, limit):
    """The row of a run without the check, and the point."""
    row, x = {'set': Path(path).parent.name, 'instance': Path(path).stem, 'method': method}, None
    try:
        d = _load(path)
        row |= {'n': d['n'], 'rows': len(d['con']), 'pairs': len(d['comp'])}
        row |= {'sense': 1 if d['sense'] == 'min' else -1, 'best_known': d.get('best_known')}
        found, x = (_baseline if method in baselines.HOMOTOPIES else _hybrid)(path, method, limit)
        row |= found
        if x is not None:
            row |= _measure(d, x)
    except Exception as error:
        row |= {'status': 'exception', 'error': f'{type(error).__name__}: {error}'[:200]}
    return row, x


def _check(path, x):
    """The columns of the check of B-stationarity."""
    try:
        verdict = b_stationarity.check(_functions(path), x)
    except Exception as error:
        return {'error': f'check: {type(error).__name__}: {error}'[:200]}
    return {
        'b_stationary': verdict.b_stationary,
        'lpec_value': verdict.value,
        'lpec_binaries': verdict.binaries,
        'moved': verdict.moved,
    }


@lru_cache(1)
def _load(path):
    import mpcc_json  # beside the instances

    return mpcc_json.load(path)


@lru_cache(1)
def _functions(path):
    return Instance(_load(path))


@lru_cache(1)
def _compiled(path):
    """The model, its compiled form and the CPU seconds for it, shared by the baselines; ``mpec_hybrid`` compiles its own model."""
    import mpcc_json

    m, started = mpcc_json.to_pyomo(_load(path)), time.process_time()
    compiled = expanded(m)
    return m, compiled, time.process_time() - started


def expanded(m):
    """The compiled form of a model as the baselines take it."""
    return compile_mpcc(read_mpcc(m), HierarchicalTimer(), expanded=True)


def _point(d, m, values):
    """Variables in the instance's order; those that no active component contains keep their initial value."""
    start = np.clip(d['x0'], d['lb'], d['ub'])
    return np.array([values.get(v, start[j]) for j, v in m.x.items()], dtype=float)


def _measure(d, x):
    """Residuals, objective, and the relative gap to the best known objective (negative: better)."""
    import mpcc_json

    r = _residuals(mpcc_json, d, x)
    row = {'violation': r['feas'], 'complementarity': r['comp'], 'objective': r['obj']}
    row['solved'] = bool(r['feas'] <= SOLVED and r['comp'] <= SOLVED)
    best = d.get('best_known')
    if best is not None:
        row['gap'] = (r['obj'] - best) * (1 if d['sense'] == 'min' else -1) / max(1.0, abs(best))
    return row


def _residuals(mpcc_json, d, x):
    """Residuals of the reader; infinite where the instance cannot be evaluated."""
    try:
        return mpcc_json.residuals(d, x.tolist())
    except (ArithmeticError, ValueError, TypeError):
        return {'feas': np.inf, 'comp': np.inf, 'obj': np.nan}


def _baseline(path, method, limit):
    import mpcc_json

    d, (m, c, compiling) = _load(path), _compiled(path)

    def point(w):
        return _point(d, m, ComponentMap(zip(c.variables, w)))

    def judge(w):
        r = _residuals(mpcc_json, d, point(w))
        return r['feas'], r['comp']

    answer = baselines.solve(method, c, judge, limit)
    row = {name: getattr(answer, name) for name in ('status', 'nlps', 'iterations')}
    row |= {'eps_last': answer.last, 'time': compiling + answer.cpu, 'compile': compiling}
    return row, point(answer.w)


def split_methods(text):
    """Methods, separated by ; or , except where the next word is an option of the method before."""
    return re.split(r'[;,](?!\w+=)', text)


def read_options(method):
    """Options of mpec_hybrid in ``hybrid:name=value,name=value``: integers, floats, words."""
    name, _, given = method.partition(':')
    if name != 'hybrid':
        raise ValueError(f"unknown method: {method}")
    return {key: _number(value) for key, value in (item.split('=') for item in given.split(',') if item)}


def _number(text):
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def _hybrid(path, method, limit):
    import mpcc_json

    d = _load(path)
    m = mpcc_json.to_pyomo(d)
    started, cpu = time.perf_counter(), time.process_time()
    options = {'time_limit': limit, 'raise_exception_on_nonoptimal_result': False, 'load_solutions': False}
    results = SolverFactory('mpec_hybrid').solve(m, **options, **read_options(method))
    total, cpu = time.perf_counter() - started, time.process_time() - cpu
    info, timer = results.extra_info, results.timing_info.timer
    row = {name: _seconds(timer, name) for name in PHASES}
    row |= {'status': results.termination_condition.name, 'certified': info.stationarity == 'B', 'total': total}
    row |= {'time': cpu, 'iterations': info.nlp_iterations}
    row |= {name: getattr(info, name) for name in ('nlps', 'lpecs', 'binaries', 'eps_last')}
    if not results.solution_loader.get_number_of_solutions():
        return row, None
    return row, _point(d, m, results.solution_loader.get_vars())


def _seconds(timer, name):
    """Seconds in a phase; 0 if it did not run."""
    try:
        return timer.get_total_time(name)
    except (KeyError, RuntimeError):
        return 0.0
