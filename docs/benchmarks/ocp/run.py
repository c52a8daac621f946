"""Optimal control problems with switches: pyomo_fesd at its defaults against nosnoc 0.2.0 at its defaults.

    .venv/bin/pip install nosnoc==0.2.0
    .venv/bin/python docs/benchmarks/ocp/run.py [--only sliding,motor] [--fresh] [--limit 120] [--summary]

Same control stages, elements and collocation points.  For each problem and method (1) times: three runs from the model's own
initial values, each in a process of its own, from the model to the solution, without imports; (2) starts: ten random controls, the
same for both.  Writes rows.csv, one row a run, summary.csv and summary.png beside this file; runs that have a row are skipped.
"""

import argparse
import importlib
import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from benchmarks.ocp import replay, summary

HERE = Path(__file__).parent
METHODS = ('pyomo_fesd', 'nosnoc')
REPEATS, STARTS, SEED = 3, 10, 1
KEY = ('problem', 'method', 'run', 'number')
COLUMNS = (*KEY, 'status', 'certified', 'seconds', 'iterations', 'nlps', 'objective', 'off', 'missed')


def module(problem):
    """The model file of a problem."""
    return importlib.import_module(f'benchmarks.ocp.{problem}')


def random_controls(problem, number):
    """Controls of all stages, uniform between their bounds; None, for number 0, means the model's own initial values."""
    p = module(problem)
    if number == 0:
        return None
    low, high = p.U_RANGE
    return np.random.default_rng([SEED, number]).uniform(low, high, (p.STAGES, p.CONTROLS))


def with_pyomo_fesd(p, controls, limit):
    """Build, discretise and solve at the defaults; return the row and the controls by stage."""
    import pyomo.environ as pyo

    import pyomo_fesd  # noqa: F401

    started = time.perf_counter()
    m = p.build()
    ends = sorted(m.t)[1:]
    p.discretise(m)
    if controls is not None:
        initialise(m, ends, controls)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit)
    seconds = time.perf_counter() - started
    (objective,) = m.component_data_objects(pyo.Objective, active=True)
    used = [[pyo.value(v) for v in _controls_at(m, end)] for end in ends]
    return {
        'status': str(results.solver.termination_condition),
        'certified': str(results.solver.stationarity) == 'B',
        'seconds': seconds,
        'iterations': int(results.solver.nlp_iterations),
        'nlps': int(results.solver.nlps),
        'objective': pyo.value(objective),
    }, used


def initialise(m, ends, controls):
    """Set the controls (stages, controls) as initial values; ``ends`` are the ends of the stages."""
    for t in m.t:
        stage = int(np.searchsorted(ends, t - 1e-9))
        for v, value in zip(_controls_at(m, t), controls[stage]):
            v.set_value(float(value), skip_validation=True)


def _controls_at(m, t):
    return [m.u[t]] if m.u.dim() == 1 else [m.u[t, i] for i in m.i]


def with_nosnoc(p, controls, limit):
    """Solve the twin at nosnoc's defaults; return the row and the controls by stage."""
    import nosnoc  # noqa: F401

    found = p.with_nosnoc(u=controls)
    return {
        'status': found['status'],
        'certified': '',
        'seconds': found['build'] + found['solve'],
        'iterations': found['iterations'],
        'nlps': found['nlps'],
        'objective': float(found['objective']),
    }, found['u']


SOLVERS = {'pyomo_fesd': with_pyomo_fesd, 'nosnoc': with_nosnoc}


def measure(problem, method, run, number, limit):
    """One row."""
    p = module(problem)
    row = dict(zip(KEY, (problem, method, run, number)))
    try:
        found, used = SOLVERS[method](p, random_controls(problem, number if run == 'start' else 0), limit)
    except Exception as error:
        return row | {'status': f'{type(error).__name__}: {error}'[:100]}
    return row | found | {'off': found['objective'] / p.REFERENCE - 1, 'missed': replayed(p, used)}


def replayed(p, used):
    """Distance to the goal at which the plant ends with these controls; empty for a problem without a goal."""
    if not hasattr(p, 'plant'):
        return ''
    try:
        end, _ = replay.replay(p.plant, p.START, used, np.full(p.STAGES, p.HORIZON / p.STAGES))
    except RuntimeError as error:
        return str(error)
    return p.missed(end)


def batches(problem, method):
    """(run, numbers) of each process: a process for each timed run, and one for all starts."""
    if method == 'nosnoc' and module(problem).with_nosnoc is None:
        return []
    starts = [('start', range(1, STARTS + 1))] if hasattr(module(problem), 'U_RANGE') else []
    return [('time', [k]) for k in range(REPEATS)] + starts


def study(problems, limit, fresh):
    """Measure the missing rows."""
    rows = Rows(HERE / 'rows.csv', KEY, COLUMNS, digits=12, fresh=fresh)
    for problem in problems:
        for method in METHODS:
            for run, numbers in batches(problem, method):
                missing = [k for k in numbers if (problem, method, run, k) not in rows]
                if missing:
                    _run_batch(rows, (problem, method, run), missing, limit)


def _run_batch(rows, batch, numbers, limit):
    """Run in a process of its own; runs that it does not reach get its status."""
    arguments = ('--child', *batch, ','.join(map(str, numbers)), '--limit', limit)
    lines, status = json_lines(__file__, *arguments, limit=limit * len(numbers) + 60)
    found = {row['number']: row for row in lines}
    for k in numbers:
        row = found.get(k) or dict(zip(KEY, (*batch, k))) | {'status': status}
        rows.add(row)
        print(' '.join(str(round(v, 5) if isinstance(v, float) else v) for v in row.values()), flush=True)


def main():
    """Measure the missing rows, then write the summary and the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', type=lambda text: text.split(','), default=summary.PROBLEMS, help="problems, by name")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--limit', type=float, default=120, help="seconds for each run")
    parser.add_argument('--summary', action='store_true', help="run nothing")
    parser.add_argument('--child', nargs=4, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.child:
        problem, method, run, numbers = chosen.child
        for k in map(int, numbers.split(',')):
            print(json.dumps(measure(problem, method, run, k, chosen.limit), default=float), flush=True)
        return
    if not chosen.summary:
        study(chosen.only, chosen.limit, chosen.fresh)
    summary.write(HERE)


if __name__ == '__main__':
    main()
