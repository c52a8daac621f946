"""1,000 scenarios of the tank on two processes, killed in the middle and resumed; and how long one and two processes take.

    .venv/bin/pip install distributed
    .venv/bin/python docs/benchmarks/sweep/run.py

Writes rows.csv (the scenarios, with the errors against scipy), disagreements.csv, runs.csv (kill and resume), scaling.csv and
summary.png beside this file.  The sweeps run in processes of their own, each with its workers in one group, which is killed:

    run.py pool|dask PROCESSES NUMBER PATH
"""

import csv
import os
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks
import numpy as np
import pandas as pd
from benchmarks.sweep.scenarios import NUMBER, OUTPUTS, RANGES, build, reference, table
from matplotlib.figure import Figure

import pyomo_fesd

HERE = Path(__file__).parent
PROCESSES, KILLED_AT = 2, 400
SCALING_NUMBER, REPEATS = 20, 1
ERRORS = {f'error of {name}': name for name in OUTPUTS}
COLUMNS = ['scenario', *RANGES, 'outcome', 'certified', 'reason', 'seconds', *OUTPUTS, *ERRORS]


@contextmanager
def pool(processes):
    """A pool of processes."""
    with ProcessPoolExecutor(processes, mp_context=get_context('spawn')) as executor:
        yield executor


@contextmanager
def dask(processes):
    """A client of Dask with as many local workers."""
    from distributed import Client, LocalCluster

    with LocalCluster(n_workers=processes, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        yield client


EXECUTORS = {'pool': pool, 'dask': dask}


def sweep_here(kind, processes, number, path):
    """What the killed process does; prints the seconds of the sweep, without the start of the workers."""
    with EXECUTORS[kind](int(processes)) as executor:
        begun = time.perf_counter()
        pyomo_fesd.sweep(build, table(int(number)), OUTPUTS, executor=executor, path=path, progress=False)
        print(time.perf_counter() - begun)


def start(kind, processes, number, path):
    """Start ``sweep_here`` in a process group of its own."""
    root = benchmarks.ROOT
    paths = os.pathsep.join(map(str, (root, root / 'docs', root / 'examples', root / 'tests')))
    command = [sys.executable, __file__, kind, str(processes), str(number), str(path)]
    environment = os.environ | {'PYTHONPATH': paths, 'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'}
    return subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True, env=environment, text=True)


def finish(process):
    """Wait; returns the seconds of the sweep."""
    output, _ = process.communicate()
    if process.returncode:
        raise RuntimeError(f"the sweep ended with {process.returncode}")
    return float(output.split()[-1])


def lines(path):
    """Complete lines of a file."""
    content = path.read_bytes() if path.exists() else b''
    return content[: content.rfind(b'\n') + 1]


def killed_and_resumed(kind, path):
    """Kill the sweep and all its workers when the file has ``KILLED_AT`` rows, resume; returns a row of runs.csv."""
    process = start(kind, PROCESSES, NUMBER, path)
    while lines(path).count(b'\n') <= KILLED_AT:
        if process.poll() is not None:
            raise RuntimeError("the sweep ended before it could be killed")
        time.sleep(0.1)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = lines(path)
    finish(start(kind, PROCESSES, NUMBER, path))
    after = path.read_bytes()
    numbers = [int(row['scenario']) for row in csv.DictReader(after.decode().splitlines())]
    return {
        'executor': kind,
        'rows at the kill': before.count(b'\n') - 1,
        'rows at the end': len(numbers),
        'scenarios without a row': len(set(range(NUMBER)) - set(numbers)),
        'scenarios with two rows': len(numbers) - len(set(numbers)),
        'rows of before that changed': 0 if after.startswith(before) else 1,
    }


def with_errors(path):
    """The rows of a sweep in the order of the scenarios, with the errors of the outputs against ``reference``."""
    rows, scenarios = pd.read_csv(path).sort_values('scenario').set_index('scenario'), table()
    exact = pd.DataFrame([reference(**values) for values in scenarios.to_dict('records')])
    for column, name in ERRORS.items():
        rows[column] = rows[name] - exact[name]
    # a different number of switches has other first and last ones
    rows.loc[rows['error of switches'] != 0, ['error of first switch', 'error of last switch']] = np.nan
    return rows.reset_index()[COLUMNS]


def counts(rows):
    """Counts and largest errors of the rows of an executor."""
    agree = rows[rows['error of switches'] == 0]
    found = {'certified': int(rows['certified'].sum()), 'other number of switches than scipy': len(rows) - len(agree)}
    for column in list(ERRORS)[1:]:
        found[f'median {column}'], found[f'largest {column}'] = agree[column].abs().median(), agree[column].abs().max()
    return found


def scaling():
    """Seconds of the first scenarios with one and two processes, in turn; 'load' is the number of jobs on the machine before."""
    for repeat in range(REPEATS):
        for kind in EXECUTORS:
            for processes in (1, 2):
                with tempfile.TemporaryDirectory() as folder:
                    load = os.getloadavg()[0]
                    seconds = finish(start(kind, processes, SCALING_NUMBER, Path(folder) / 'rows.csv'))
                yield {'executor': kind, 'repeat': repeat, 'processes': processes, 'seconds': seconds, 'load': load}


def disagreements(rows):
    """Scenarios in which scipy has another number of switches, with its number at shorter steps."""
    scenarios = table().to_dict('records')
    for row in rows[rows['error of switches'] != 0].to_dict('records'):
        values = scenarios[row['scenario']]
        numbers = {f'scipy, steps up to {step} s': reference(**values, max_step=step)['switches'] for step in (0.25, 0.005)}
        yield (
            {'scenario': row['scenario'], 'sweep': row['switches']} | numbers | {'error of gas at end': row['error of gas at end']}
        )


def draw(rows):
    """Where the scenarios end, and the errors of the times and holdups."""
    figure = Figure(figsize=(10, 4), layout='constrained')
    plane, errors = figure.subplots(1, 2)
    points = plane.scatter(rows['feed'] / rows['valve'], rows['gas at end'], c=rows['switches'], s=9, cmap='viridis')
    figure.colorbar(points, label='switches')
    plane.set_xlabel('feed / coefficient of the valve (atm)')
    plane.set_ylabel('gas at the end (mol)')
    for name in ('first switch', 'last switch', 'gas at end', 'liquid at end'):
        found = np.sort(rows[f'error of {name}'].abs().dropna().clip(lower=1e-14))
        errors.plot(found, np.arange(1, found.size + 1), label=f'{name} ({"s" if "switch" in name else "mol"})')
    errors.set_xscale('log')
    errors.set_xlabel('difference from scipy')
    errors.set_ylabel('scenarios up to it')
    errors.legend()
    return figure


def main():
    """Both sweeps, the scaling, tables and picture."""
    runs = []
    for kind in EXECUTORS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / 'rows.csv'
            row = killed_and_resumed(kind, path)
            rows = with_errors(path)
        runs.append(row | counts(rows))
        print(runs[-1], flush=True)
        if kind == 'pool':
            rows.to_csv(HERE / 'rows.csv', index=False, float_format='%.6g')
            pd.DataFrame(disagreements(rows)).to_csv(HERE / 'disagreements.csv', index=False, float_format='%.3g')
            draw(rows).savefig(HERE / 'summary.png', dpi=150)
    rounded = pd.DataFrame(runs).T.map(lambda cell: f'{cell:.3g}' if isinstance(cell, float) else cell)
    rounded.to_csv(HERE / 'runs.csv', header=False)
    pd.DataFrame(scaling()).to_csv(HERE / 'scaling.csv', index=False, float_format='%.4g')


if __name__ == '__main__':
    sweep_here(*sys.argv[1:]) if len(sys.argv) > 1 else main()
