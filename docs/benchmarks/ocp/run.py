"""Optimal control problems with switches: pyomo_fesd at its defaults against nosnoc 0.2.0 at its defaults.

    .venv/bin/pip install nosnoc==0.2.0
    .venv/bin/python docs/benchmarks/ocp/run.py [--only sliding,motor] [--fresh] [--limit 120] [--summary]

Same control stages, elements and collocation points.  Eleven starts of each problem: the model's own initial values (start 0), and
ten random controls, the same for both methods.  The controls that a run finds are replayed on the plant, with located events, which
gives their true cost.  Writes rows.csv, one row a run, summary.csv and summary.png beside this file; runs that have a row are
skipped.
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
from benchmarks.ocp import summary

HERE = Path(__file__).parent
METHODS = ('pyomo_fesd', 'nosnoc')
#: Number of random starts.
STARTS, SEED = 10, 1
KEY = ('problem', 'method', 'start')
OF_SOLUTION = ('status', 'certified', 'seconds', 'cpu', 'iterations', 'nlps', 'objective', 'off')
OF_REPLAY = ('replayed', 'off replayed', 'missed', 'status of replay')
COLUMNS = (*KEY, *OF_SOLUTION, *OF_REPLAY)


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
    """Build, discretise and solve at the defaults; return the row, the controls by stage, and the lengths of the stages."""
    import pyomo.environ as pyo

    import pyomo_fesd  # noqa: F401

    started, cpu = time.perf_counter(), time.process_time()
    m = p.build()
    ends = sorted(m.t)[1:]
    p.discretise(m)
    if controls is not None:
        initialise(m, ends, controls)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit)
    spent = {'seconds': time.perf_counter() - started, 'cpu': time.process_time() - cpu}
    (objective,) = m.component_data_objects(pyo.Objective, active=True)
    used = [[pyo.value(v) for v in _controls_at(m, end)] for end in ends]
    return {
        'status': str(results.solver.termination_condition),
        'certified': str(results.solver.stationarity) == 'B',
        **spent,
        'iterations': int(results.solver.nlp_iterations),
        'nlps': int(results.solver.nlps),
        'objective': pyo.value(objective),
    }, (used, equal_lengths(p, m.T.value if hasattr(m, 'T') else p.HORIZON))


def equal_lengths(p, duration):
    """Lengths of the control stages."""
    return np.full(p.STAGES, duration / p.STAGES)


def initialise(m, ends, controls):
    """Set the controls (stages, controls) as initial values; ``ends`` are the ends of the stages."""
    for t in m.t:
        stage = int(np.searchsorted(ends, t - 1e-9))
        for v, value in zip(_controls_at(m, t), controls[stage]):
            v.set_value(float(value), skip_validation=True)


def _controls_at(m, t):
    return [m.u[t]] if m.u.dim() == 1 else [m.u[t, i] for i in m.i]


def with_nosnoc(p, controls, limit):
    """Solve the twin at nosnoc's defaults; return the row, the controls by stage, and the lengths of the stages."""
    import nosnoc  # noqa: F401

    found = p.with_nosnoc(u=controls)
    return {
        'status': found['status'],
        'certified': '',
        'seconds': found['build'] + found['solve'],
        'cpu': found['cpu'],
        'iterations': found['iterations'],
        'nlps': found['nlps'],
        'objective': float(found['objective']),
    }, (found['u'], found['lengths'] if 'lengths' in found else equal_lengths(p, p.HORIZON))


SOLVERS = {'pyomo_fesd': with_pyomo_fesd, 'nosnoc': with_nosnoc}


def measure(problem, method, start, limit):
    """One row."""
    p = module(problem)
    row = dict(zip(KEY, (problem, method, start)))
    try:
        found, used = SOLVERS[method](p, random_controls(problem, start), limit)
    except Exception as error:
        return row | {'status': f'{type(error).__name__}: {error}'[:100]}
    return row | found | {'off': found['objective'] / p.REFERENCE - 1} | replayed(p, *used)


def replayed(p, controls, lengths):
    """The true cost of controls, and the distance to the goal, if there is one, at which the plant ends."""
    try:
        end, cost = p.replay_controls(controls, lengths)
    except RuntimeError as error:
        return {'status of replay': str(error)}
    missed = '' if p.missed is None else p.missed(end)
    return {'replayed': float(cost), 'off replayed': float(cost / p.REFERENCE - 1), 'missed': missed, 'status of replay': 'ok'}


def study(problems, limit, fresh):
    """Measure the missing rows, with a process for each problem and method."""
    rows = Rows(HERE / 'rows.csv', KEY, COLUMNS, digits=12, fresh=fresh)
    for problem in problems:
        for method in METHODS:
            missing = [k for k in range(STARTS + 1) if (problem, method, k) not in rows]
            if missing and states(problem, method):
                _run_batch(rows, (problem, method), missing, limit)


def states(problem, method):
    """Whether the method can state the problem."""
    return method == 'pyomo_fesd' or module(problem).with_nosnoc is not None


def print_rows(problem, method, starts, limit):
    """Print one line of JSON for each start, after a run that loads everything and is not counted."""
    measure(problem, method, 0, limit)
    for k in starts:
        print(json.dumps(measure(problem, method, k, limit), default=float), flush=True)


def _run_batch(rows, batch, starts, limit):
    """Run in a process of its own; runs that it does not reach get its status."""
    arguments = ('--child', *batch, ','.join(map(str, starts)), '--limit', limit)
    lines, status = json_lines(__file__, *arguments, limit=limit * (len(starts) + 1) + 60)
    found = {row['start']: row for row in lines}
    for k in starts:
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
    parser.add_argument('--child', nargs=3, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.child:
        problem, method, starts = chosen.child
        print_rows(problem, method, [int(k) for k in starts.split(',')], chosen.limit)
        return
    if not chosen.summary:
        study(chosen.only, chosen.limit, chosen.fresh)
    summary.write(HERE)


if __name__ == '__main__':
    main()
