"""Scale: time and memory of every phase over the number of elements and the number of switching subsystems.

    .venv/bin/python docs/benchmarks/scale.py [--only tank] [--only cascade] [--fresh]

Tank: N = 25 ... 1600 elements; cascade: S = 1 ... 200 tanks (``scale_cascade.py``) on 20 elements; Radau with 3 points.  Each with
``mpec_hybrid`` alone and with ``simulate`` before it (``warm_start``).  Every run is a process of its own; its row goes to
scale.csv at once and is not run again unless ``--fresh`` is given.  Writes scale.csv, scale_fit.csv and scale.png.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pyomo.environ as pyo
from matplotlib.figure import Figure
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.factory import SolverFactory

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / 'examples')]

import gas_liquid_tank  # noqa: E402
import scale_cascade  # noqa: E402

import pyomo_fesd  # noqa: E402

#: problem -> what its size counts, sizes
SIZES = {'tank': ('N', (25, 50, 100, 200, 400, 800, 1600)), 'cascade': ('S', (1, 2, 5, 10, 20, 50, 100, 200))}
METHODS = ('hybrid', 'simulate')
KEY = ['problem', 'size', 'method']
ELEMENTS_OF_CASCADE, POINTS = 20, 3
#: Seconds for one run.
LIMIT = 120
PHASES = ('build', 'transform', 'simulate', 'compile', 'NLPs', 'LPECs', 'load', 'total')
#: Sizes below this part of the largest do not count for a slope: there fixed costs show.
FITTED = 1 / 20
#: Phases that never take more seconds than this are left out.
SHOWN = 0.2
SHARE = 'transform and compile / total, at a quarter of the largest size'
TABLE, FITS, PICTURE = (HERE / name for name in ('scale.csv', 'scale_fit.csv', 'scale.png'))


# One run, in its own process


class Watch(HierarchicalTimer):
    """A timer that notes the peak of memory at the end of each phase."""

    def __init__(self):
        super().__init__()
        self.peak = {}

    def stop(self, identifier):
        """End a phase."""
        super().stop(identifier)
        self.peak[identifier] = memory()


def memory():
    """Peak of this process until now, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def tank(N):
    """Model, number of elements, and the error of a solution."""
    m = gas_liquid_tank.build()
    return m, N, lambda: abs(pyomo_fesd.switches(m)[0].time - gas_liquid_tank.EXACT['t_s'])


def cascade(S):
    """The same for the cascade."""
    m = scale_cascade.build(S)

    def error():
        exact = scale_cascade.exact(S)
        found = [s.time for s in pyomo_fesd.switches(m)]
        return max(abs(a - b) for a, b in zip(found, exact)) if len(found) == len(exact) else np.inf

    return m, ELEMENTS_OF_CASCADE, error


PROBLEMS = {'tank': tank, 'cascade': cascade}


def run(problem, size, method):
    """One row."""
    timer, clock, before = Watch(), [time.perf_counter()], memory()
    m, N, error = PROBLEMS[problem](size)
    clock.append(time.perf_counter())
    timer.peak['model'] = memory()
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=N, ncp=POINTS)
    clock.append(time.perf_counter())
    timer.peak['transform'] = memory()
    if method == 'simulate':
        pyomo_fesd.simulate(m)
        timer.peak['simulate'] = memory()
    clock.append(time.perf_counter())
    results = SolverFactory('mpec_hybrid').solve(m, timer=timer, warm_start=method == 'simulate')
    clock.append(time.perf_counter())
    spent = {name: timer.get_total_time(name) for name in timer.timers}
    row = dict(zip(('build', 'transform', 'simulate'), np.diff(clock)))
    row['compile'] = spent['compile'] + spent['build']
    row['NLPs'] = spent.get('relaxation', 0) + spent.get('branch', 0)
    row['LPECs'] = spent.get('lpec', 0)
    row['load'] = clock[-1] - clock[-2] - row['compile'] - row['NLPs'] - row['LPECs']
    row['total'] = clock[-1] - clock[0]
    info = results.extra_info
    row |= {f'MB after {name}': timer.peak.get(name) for name in ('model', 'transform', 'simulate', 'compile')}
    row |= {'MB at the end': memory(), 'MB before': before}
    row |= {
        'pairs': info.pairs,
        'nlps': info.nlps,
        'iterations': info.nlp_iterations,
        'lpecs': info.lpecs,
        'binaries': info.binaries,
    }
    return row | {'status': info.stationarity, 'error': error()}


def in_a_process(problem, size, method):
    """The row of a run, or its status where it gives none."""
    command = [sys.executable, __file__, '--run', problem, str(size), method]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return {'status': f'more than {LIMIT} s'}
    if done.returncode:
        return {'status': (done.stderr.strip().splitlines() or ['no message'])[-1]}
    return json.loads(done.stdout.splitlines()[-1])


# All of them


def measure(problems):
    """Every run that has no row yet."""
    for problem in problems:
        for size in SIZES[problem][1]:
            for method in METHODS:
                known = read()
                if (
                    not known.empty
                    and ((known['problem'] == problem) & (known['size'] == size) & (known['method'] == method)).any()
                ):
                    continue
                row = {'problem': problem, 'size': size, 'method': method} | in_a_process(problem, size, method)
                pd.concat([known, pd.DataFrame([row])]).to_csv(TABLE, index=False, float_format='%.6g')
                print(problem, size, method, row['status'], f'{row.get("total", np.nan):.2f} s', flush=True)


def read():
    """The rows that there are."""
    return pd.read_csv(TABLE) if TABLE.exists() else pd.DataFrame()


def slope(sizes, values):
    """Exponent of a power law through the larger sizes; NaN if there are less than three."""
    kept = (sizes >= FITTED * sizes.max()) & (values > 0)
    return np.polyfit(np.log(sizes[kept]), np.log(values[kept]), 1)[0] if kept.sum() > 2 else np.nan


def fit(table):
    """Exponents of each phase and of the peak of memory."""
    rows = []
    for (problem, method), runs in table[table['status'] == 'B'].groupby(['problem', 'method'], sort=False):
        exponents = {phase: slope(runs['size'], runs[phase]) for phase in PHASES if runs[phase].max() > SHOWN}
        peak = slope(runs['size'], runs['MB at the end'] - runs['MB before'])
        quarter = runs[runs['size'] == max(SIZES[problem][1]) // 4]
        share = ((quarter['transform'] + quarter['compile']) / quarter['total']).mean()
        rows.append({'problem': problem, 'method': method} | exponents | {'memory': peak, SHARE: share})
    return pd.DataFrame(rows)


def draw(table, fits):
    """Time by phase and memory, log-log, with the slopes."""
    figure = Figure(figsize=(12, 9), layout='constrained')
    axes = figure.subplots(len(SIZES), 3, squeeze=False)
    for row, (problem, (letter, sizes)) in zip(axes, SIZES.items()):
        for axis, method in zip(row, METHODS):
            runs = table[(table['problem'] == problem) & (table['method'] == method) & (table['status'] == 'B')]
            exponents = fits[(fits['problem'] == problem) & (fits['method'] == method)]
            for phase in PHASES:
                if phase in exponents and np.isfinite(exponents[phase]).any():
                    width = 2.5 if phase == 'total' else 1.2
                    label = f'{phase}: {letter}^{exponents[phase].iloc[0]:.2f}'
                    axis.loglog(runs['size'], runs[phase], 'o-', linewidth=width, markersize=3, label=label)
            axis.set_title(f'{problem}, {method}')
            axis.set_ylabel('time (s)')
            slopes = f': {letter}^{exponents["memory"].iloc[0]:.2f}' if len(exponents) else ''
            row[2].loglog(runs['size'], runs['MB at the end'] - runs['MB before'], 'o-', markersize=3, label=method + slopes)
        row[2].set_title(f'{problem}, peak memory')
        row[2].set_ylabel('MB')
        for axis in row:
            axis.set_xlabel('elements N' if letter == 'N' else 'tanks S')
            axis.set_xticks(sizes, sizes)
            axis.minorticks_off()
            if axis.get_legend_handles_labels()[0]:
                axis.legend(fontsize=8, loc='upper left')
            axis.grid(True, alpha=0.2)
    figure.savefig(PICTURE, dpi=120)


def main():
    """Measure what is missing, fit and draw."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument('--only', choices=list(SIZES), action='append')
    options.add_argument('--fresh', action='store_true')
    options.add_argument('--run', nargs=3, metavar=('PROBLEM', 'SIZE', 'METHOD'), help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.run:
        problem, size, method = given.run
        print(json.dumps(run(problem, int(size), method), default=str))
        return
    if given.fresh:
        TABLE.unlink(missing_ok=True)
    measure(given.only or list(SIZES))
    table = read()
    fits = fit(table)
    fits.to_csv(FITS, index=False, float_format='%.3f')
    draw(table, fits)
    print(fits.to_string(index=False, float_format='{:.2f}'.format))


if __name__ == '__main__':
    main()
