"""1,000 scenarios of the tank on two processes, killed in the middle and resumed; and how long one and two processes take.

    .venv/bin/pip install distributed
    .venv/bin/python docs/benchmarks/sweep/run.py               everything but the following two
    .venv/bin/python docs/benchmarks/sweep/run.py --scaling     needs a machine on which nothing else runs, and two minutes there
    .venv/bin/python docs/benchmarks/sweep/run.py --review      warnings of the first 30 scenarios and of those that disagree

Writes rows.csv (the scenarios, with the errors against scipy), disagreements.csv, runs.csv (kill and resume) and summary.png;
scaling.csv and scaling.png; review.csv and review_summary.csv, beside this file.  The sweeps of several processes run in processes
of their own, each with its workers in one group, which is killed:

    run.py pool|dask PROCESSES NUMBER PATH
"""

import csv
import os
import resource
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
SCALING_NUMBER, REVIEWED = 40, 30
ERRORS = {f'error of {name}': name for name in OUTPUTS}
COLUMNS = ['scenario', *RANGES, 'outcome', 'certified', 'reason', 'warnings', 'seconds', *OUTPUTS, *ERRORS]
#: Words of the message on a crossing that the elements do not detect.
MISSED = 'leaves its region between two collocation points'


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
    rows, scenarios = pd.read_csv(path, keep_default_na=False, na_values={name: '' for name in OUTPUTS}), table().to_dict('records')
    rows = rows.sort_values('scenario').set_index('scenario')
    exact = pd.DataFrame([reference(**scenarios[number]) for number in rows.index], index=rows.index)
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
    """Seconds of the first scenarios with one and two processes.

    'CPU seconds' are those of all processes; 'load' is the number of jobs on the machine before, 0 where it was free.
    """
    for kind in EXECUTORS:
        alone = None
        for processes in (1, 2):
            load, before = os.getloadavg()[0], cpu_of_children()
            with tempfile.TemporaryDirectory() as folder:
                seconds = finish(start(kind, processes, SCALING_NUMBER, Path(folder) / 'rows.csv'))
            alone = alone or seconds
            yield {
                'executor': kind,
                'processes': processes,
                'scenarios': SCALING_NUMBER,
                'seconds': seconds,
                'times as fast': alone / seconds,
                'CPU seconds': cpu_of_children() - before,
                'load': load,
            }


def cpu_of_children():
    """CPU seconds of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure_scaling():
    """Write the table and picture of ``scaling``."""
    found = pd.DataFrame(scaling())
    found.to_csv(HERE / 'scaling.csv', index=False, float_format='%.3g')
    print(found.to_string())
    draw_scaling(found).savefig(HERE / 'scaling.png', dpi=150)


def draw_scaling(found):
    """Seconds of each run, with the load before it."""
    figure = Figure(figsize=(5.5, 3.4), layout='constrained')
    axis = figure.subplots()
    bars = axis.bar([f'{kind}, {processes}' for kind, processes in zip(found['executor'], found['processes'])], found['seconds'])
    axis.bar_label(bars, [f'{row["times as fast"]:.2f} x\nload {row["load"]:.1f}' for _, row in found.iterrows()])
    axis.set_xlabel('executor, processes (above: times as fast, load)')
    axis.set_ylabel(f'seconds of {found["scenarios"][0]} scenarios')
    axis.margins(y=0.2)
    return figure


def review():
    """Write the warnings of some scenarios beside the differences from scipy, and how often both agree."""
    wrong = [row['scenario'] for row in csv.DictReader((HERE / 'rows.csv').open()) if float(row['error of switches'])]
    numbers = sorted({*range(REVIEWED), *map(int, wrong)})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'rows.csv'
        pyomo_fesd.sweep(build, table().loc[numbers], OUTPUTS, path=path, progress=False)
        rows = pd.read_csv(path)
        rows['scenario'] = [numbers[position] for position in rows['scenario']]
        rows.to_csv(path, index=False)
        rows = with_errors(path)
    rows['missed crossing'] = rows['warnings'].str.contains(MISSED)
    rows['other warning'] = (rows['warnings'] != '') & ~rows['missed crossing']
    kept = ['scenario', 'switches', 'error of switches', 'error of gas at end', 'error of liquid at end', 'missed crossing']
    rows[[*kept, 'other warning', 'warnings', 'seconds']].to_csv(HERE / 'review.csv', index=False, float_format='%.3g')
    cases = rows.assign(switches=np.where(rows['error of switches'] == 0, 'as scipy', 'others than scipy'))
    cases['largest error'] = rows[['error of gas at end', 'error of liquid at end']].abs().max(axis=1)
    found = cases.groupby(['switches', 'missed crossing', 'other warning']).agg(
        **{'scenarios': ('scenario', 'size'), 'largest error at end (mol)': ('largest error', 'max')}
    )
    found.to_csv(HERE / 'review_summary.csv', float_format='%.2g')
    print(found.to_string())


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
    """Both sweeps, tables and picture."""
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


#: Arguments -> what runs.
PARTS = {(): main, ('--scaling',): measure_scaling, ('--review',): review}

if __name__ == '__main__':
    arguments = tuple(sys.argv[1:])
    PARTS[arguments]() if arguments in PARTS else sweep_here(*arguments)
