"""One run of the study, in a child process of ``run.py``: its row."""

import gc
import logging
import statistics
import time
import warnings
from dataclasses import fields

from benchmarks.common.processes import silence_output
from benchmarks.work_precision.runs import BIG_M, EVENTS, EXACT, METHODS, NOSNOC, OURS, PROBLEMS, Run
from benchmarks.work_precision.systems import Found, errors

QUANTITIES = ('state', 'switch', 'objective', 'x0', 'control', 'sensitivity')
COLUMNS = (
    *Run._fields,
    *('status', 'claimed', 'build', 'solve', 'total', 'cpu', 'nlps', 'iterations', 'x0'),
    *('error', *(f'error {name}' for name in QUANTITIES)),
)
#: Runs shorter than SHORT seconds are repeated TIMES times; the medians count.
SHORT, TIMES = 0.4, 3
#: Runs at the start of the process, so that no timed run loads a library.
WARM_UP = (Run('signum', OURS, 'Radau', 2, 4), Run('signum', NOSNOC, 'Radau', 2, 4), Run('signum', BIG_M, 'Radau', 1, 4))


def serve(pipe):
    """Answer each (run, limit) with its row."""
    silence_output()
    warnings.simplefilter('ignore')
    logging.disable(logging.ERROR)
    for run in (*WARM_UP, Run('signum', EVENTS, width=1e-6)):
        row_of(run, 30.0)
    pipe.send('ready')
    while True:
        pipe.send(row_of(*pipe.recv()))


def row_of(run, limit):
    """The row of one run, even if it fails."""
    row = run._asdict()
    try:
        found, cpu = _repeated(run, limit)
    except Exception as error:
        return row | {'status': f'{type(error).__name__}: {error}'[:120].replace('\n', ' '), 'claimed': False}
    row |= {f.name: getattr(found, f.name) for f in fields(Found) if f.name in COLUMNS and f.name not in row}
    row |= {'total': found.build + found.solve, 'cpu': cpu}
    each = errors(EXACT[run.problem], found)
    row |= {f'error {name}': error for name, error in each.items()}
    if each:
        row['error'] = max(each.values())
    return row


def _repeated(run, limit):
    """Result and CPU time; medians of several times for a short run."""
    found, cpu = _timed(run, limit)
    if found.build + found.solve < SHORT and not run.start:
        again = [(found, cpu), *(_timed(run, limit) for _ in range(TIMES - 1))]
        for name in ('build', 'solve'):
            setattr(found, name, statistics.median(getattr(f, name) for f, _ in again))
        cpu = statistics.median(c for _, c in again)
    return found, cpu


def _timed(run, limit):
    # what the run before has left is not its work
    gc.collect()
    begin = time.process_time()
    found = _answer(run, limit)
    return found, time.process_time() - begin


def _answer(run, limit):
    """Result of the method; with a difference quotient if the problem asks for dx(T)/dx0."""
    problem = PROBLEMS[run.problem]
    settings = {'K': run.K, 'N': run.N, 'scheme': run.scheme, 'width': run.width, 'limit': limit}
    method = METHODS[run.method]
    step = getattr(getattr(problem, 'system', None), 'step', None)
    if step is None:
        return method(problem.at(run.start) if run.start else problem, **settings)
    centre = problem.system.x0[0]
    low, high = (method(problem.at(centre + sign * step), **settings) for sign in (-1, 1))
    if None not in (low.state, high.state):
        high.sensitivity = float(high.state[0] - low.state[0]) / (2 * step)
    high.build, high.solve = low.build + high.build, low.solve + high.solve
    high.claimed = low.claimed and high.claimed
    return high
