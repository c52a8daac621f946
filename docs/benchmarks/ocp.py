"""Optimal control problems with switches: pyomo_fesd at its defaults against nosnoc 0.2.0 at its defaults.

    python docs/benchmarks/ocp.py [--only sliding,motor] [--fresh] [--limit 120]

Same control stages, elements and collocation points.  For each problem and method (1) times: three runs from the model's own
start values, each in a process of its own, from the model to the solution, all imports done; (2) starts: ten random controls, the
same for both.  Writes ocp.csv, a row a run, in which no run is done twice, ocp_summary.csv, and ocp.png, all beside this file.
"""

import argparse
import csv
import importlib
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE)]

PROBLEMS = ('sliding', 'motor', 'cartpole', 'tank', 'gearbox', 'ellipse')
METHODS = ('pyomo_fesd', 'nosnoc')
REPEATS, STARTS, SEED = 3, 10, 1
#: A run has found the reference's minimum if its objective is this near, relative; what is left is the grid's error.
SAME = 0.03
COLUMNS = 'problem method run number status certified seconds iterations nlps objective off missed'.split()


def module(problem):
    """The model file of a problem."""
    return importlib.import_module(f'ocp_{problem}')


def random_controls(problem, number):
    """Controls of all stages, uniform between their bounds; None for the model's own start values."""
    p = module(problem)
    if number == 0:
        return None
    low, high = p.U_RANGE
    return np.random.default_rng([SEED, number]).uniform(low, high, (p.STAGES, p.CONTROLS))


def with_pyomo_fesd(p, controls, limit):
    """Built, discretised and solved at the defaults."""
    import pyomo.environ as pyo

    import pyomo_fesd  # noqa: F401

    started = time.perf_counter()
    m = p.build()
    ends = sorted(m.t)[1:]
    p.discretise(m)
    if controls is not None:
        _start_from(m, ends, controls)
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


def _start_from(m, ends, controls):
    for t in m.t:
        stage = int(np.searchsorted(ends, t - 1e-9))
        for v, value in zip(_controls_at(m, t), controls[stage]):
            v.set_value(float(value), skip_validation=True)


def _controls_at(m, t):
    return [m.u[t]] if m.u.dim() == 1 else [m.u[t, i] for i in m.i]


def with_nosnoc(p, controls, limit):
    """The twin at nosnoc's defaults."""
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
    row = {'problem': problem, 'method': method, 'run': run, 'number': number}
    try:
        found, used = SOLVERS[method](p, random_controls(problem, number if run == 'start' else 0), limit)
    except Exception as error:
        return row | {'status': f'{type(error).__name__}: {error}'[:100]}
    return row | found | {'off': found['objective'] / p.REFERENCE - 1, 'missed': replayed(p, used)}


def replayed(p, used):
    """How far from the goal the plant really ends with these controls; nothing for those without goal."""
    if not hasattr(p, 'plant'):
        return ''
    import ocp_replay

    try:
        end, _ = ocp_replay.replay(p.plant, p.START, used, np.full(p.STAGES, p.HORIZON / p.STAGES))
    except RuntimeError as error:
        return str(error)
    return p.missed(end)


def runs(problem, method):
    """(run, numbers), each in a process of its own: the times one by one, all starts together."""
    if method == 'nosnoc' and module(problem).with_nosnoc is None:
        return []
    starts = [('start', range(1, STARTS + 1))] if hasattr(module(problem), 'U_RANGE') else []
    return [('time', [k]) for k in range(REPEATS)] + starts


def study(arguments):
    """All runs that ocp.csv does not hold yet."""
    out = HERE / 'ocp.csv'
    if arguments.fresh:
        out.unlink(missing_ok=True)
    done = set()
    if out.exists():
        done = {(r['problem'], r['method'], r['run'], int(r['number'])) for r in csv.DictReader(out.open())}
    else:
        out.write_text(','.join(COLUMNS) + '\n')
    for problem in arguments.only.split(',') if arguments.only else PROBLEMS:
        for method in METHODS:
            for run, numbers in runs(problem, method):
                todo = [k for k in numbers if (problem, method, run, k) not in done]
                if todo:
                    _child(out, problem, method, run, todo, arguments.limit)


def _child(out, problem, method, run, numbers, limit):
    """Run in a process of its own, which writes a JSON line for each row; those that it does not reach get its end as status."""
    command = [sys.executable, __file__, '--child', problem, method, run, ','.join(map(str, numbers)), '--limit', str(limit)]
    status = 'died'
    try:
        said = subprocess.run(command, capture_output=True, text=True, timeout=limit * len(numbers) + 60).stdout
    except subprocess.TimeoutExpired as error:
        said, status = (error.stdout or b'').decode(), f'stopped after {limit} s'
    rows = {row['number']: row for row in map(json.loads, (line for line in said.splitlines() if line.startswith('{')))}
    with out.open('a', newline='') as file:
        writer = csv.DictWriter(file, COLUMNS, restval='')
        for k in numbers:
            row = rows.get(k) or {'problem': problem, 'method': method, 'run': run, 'number': k, 'status': status}
            writer.writerow(row)
            print(' '.join(str(round(v, 5) if isinstance(v, float) else v) for v in row.values()), flush=True)


def main():
    """All runs, then the summary and the picture."""
    parser = argparse.ArgumentParser()
    parser.add_argument('--only', default='')
    parser.add_argument('--fresh', action='store_true')
    parser.add_argument('--limit', type=float, default=120)
    parser.add_argument('--child', nargs=4)
    arguments = parser.parse_args()
    if arguments.child:
        problem, method, run, numbers = arguments.child
        for k in map(int, numbers.split(',')):
            print(json.dumps(measure(problem, method, run, k, arguments.limit), default=float), flush=True)
        return
    study(arguments)
    import ocp_summary

    ocp_summary.main()


if __name__ == '__main__':
    main()
