"""Scale: time and memory of every phase over the number of elements and the number of switching subsystems.

    .venv/bin/python docs/benchmarks/scale/run.py [--only tank] [--only cascade] [--fresh]

Tank: N = 25 ... 1600 elements; cascade: S = 1 ... 200 tanks (``cascade.py``) on 20 elements; Radau with 3 points.  Each with
``mpec_hybrid`` alone and with ``simulate`` before it (``warm_start``).  Every run is a process of its own.  Writes rows.csv,
summary.csv (exponents) and summary.png beside this file; runs that have a row are skipped.
"""

import argparse
import gc
import json
import resource
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import gas_liquid_tank
import numpy as np
import pandas as pd
import pyomo.environ as pyo
from benchmarks.common.exact import error_of_times
from benchmarks.common.fits import exponent
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from benchmarks.scale import cascade
from matplotlib.figure import Figure
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.factory import SolverFactory

import pyomo_fesd

HERE = Path(__file__).parent
#: problem -> symbol of its size, sizes
SIZES = {'tank': ('N', (25, 50, 100, 200, 400, 800, 1600)), 'cascade': ('S', (1, 2, 5, 10, 20, 50, 100, 200))}
METHODS = ('hybrid', 'simulate')
ELEMENTS_OF_CASCADE, POINTS = 20, 3
#: Seconds for one run.
LIMIT = 120
PHASES = ('build', 'transform', 'simulate', 'compile', 'NLPs', 'LPECs', 'load', 'total')
KEY = ('problem', 'size', 'method')
COLUMNS = (
    *(*KEY, *PHASES, 'MB after model', 'MB after transform', 'MB after simulate', 'MB after compile', 'MB at the end', 'MB before'),
    *('pairs', 'nlps', 'iterations', 'lpecs', 'binaries', 'status', 'error'),
)
#: Exponents are fitted to sizes above this part of the largest; fixed costs dominate below.
FITTED = 1 / 20
#: Phases that never take more seconds than this are left out.
SHOWN = 0.2
SHARE = 'transform and compile / total, at a quarter of the largest size'


# One run, in its own process


class PeakTimer(HierarchicalTimer):
    """A timer that records the peak of memory at the end of each phase."""

    def __init__(self):
        super().__init__()
        self.peak = {}

    def stop(self, identifier):
        """End a phase."""
        super().stop(identifier)
        self.peak[identifier] = memory()


def memory():
    """Peak memory of this process until now, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def tank(N):
    """Model, number of elements, and a function for the error of its solution."""
    m = gas_liquid_tank.build()
    return m, N, lambda: abs(pyomo_fesd.switches(m)[0].time - gas_liquid_tank.EXACT['t_s'])


def tanks(S):
    """The same for the cascade."""
    m = cascade.build(S)
    return m, ELEMENTS_OF_CASCADE, lambda: error_of_times([s.time for s in pyomo_fesd.switches(m)], cascade.exact(S))


PROBLEMS = {'tank': tank, 'cascade': tanks}


def run(problem, size, method):
    """Build, transform and solve once; return time, memory and work of each phase."""
    gc.collect()  # the garbage of the imports would otherwise count to a random phase
    timer, clock, before = PeakTimer(), [time.perf_counter()], memory()
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
    info, peaks = (
        results.extra_info,
        {f'MB after {name}': timer.peak.get(name) for name in ('model', 'transform', 'simulate', 'compile')},
    )
    counts = {
        'pairs': info.pairs,
        'nlps': info.nlps,
        'iterations': info.nlp_iterations,
        'lpecs': info.lpecs,
        'binaries': info.binaries,
    }
    return (
        _seconds(clock, timer)
        | peaks
        | {'MB at the end': memory(), 'MB before': before}
        | counts
        | {'status': info.stationarity, 'error': error()}
    )


def _seconds(clock, timer):
    spent = {name: timer.get_total_time(name) for name in timer.timers}
    seconds = dict(zip(('build', 'transform', 'simulate'), np.diff(clock)))
    seconds['compile'] = spent['compile'] + spent['build']
    seconds['NLPs'] = spent.get('relaxation', 0) + spent.get('branch', 0)
    seconds['LPECs'] = spent.get('lpec', 0)
    seconds['load'] = clock[-1] - clock[-2] - seconds['compile'] - seconds['NLPs'] - seconds['LPECs']
    seconds['total'] = clock[-1] - clock[0]
    return seconds


# All rows


def measure(problems, fresh):
    """Measure the missing rows; return the file."""
    rows = Rows(HERE / 'rows.csv', KEY, COLUMNS, fresh=fresh)
    for key in ((problem, size, method) for problem in problems for size in SIZES[problem][1] for method in METHODS):
        if key not in rows:
            found, status = json_lines(__file__, '--run', *key, limit=LIMIT)
            row = dict(zip(KEY, key)) | (found[-1] if found else {'status': status})
            print(*key, row['status'], f'{row.get("total", np.nan):.2f} s', flush=True)
            rows.add(row)
    return rows.path


def fit(table):
    """Exponents of each phase and of the peak of memory."""
    rows = []
    for (problem, method), runs in table[table['status'] == 'B'].groupby(['problem', 'method'], sort=False):
        exponents = {phase: _exponent(runs['size'], runs[phase]) for phase in PHASES if runs[phase].max() > SHOWN}
        peak = _exponent(runs['size'], runs['MB at the end'] - runs['MB before'])
        quarter = runs[runs['size'] == max(SIZES[problem][1]) // 4]
        share = ((quarter['transform'] + quarter['compile']) / quarter['total']).mean()
        rows.append({'problem': problem, 'method': method} | exponents | {'memory': peak, SHARE: share})
    return pd.DataFrame(rows)


def _exponent(sizes, values):
    """Exponent over the larger sizes; NaN with fewer than three."""
    kept = (sizes >= FITTED * sizes.max()) & (values > 0)
    return exponent(sizes[kept], values[kept]) if kept.sum() > 2 else np.nan


def draw(table, fits):
    """Time by phase and memory on logarithmic axes, with the exponents."""
    figure = Figure(figsize=(12, 9), layout='constrained')
    for row, (problem, (letter, sizes)) in zip(figure.subplots(len(SIZES), 3, squeeze=False), SIZES.items()):
        for axis, method in zip(row, METHODS):
            runs = table[(table['problem'] == problem) & (table['method'] == method) & (table['status'] == 'B')]
            exponents = fits[(fits['problem'] == problem) & (fits['method'] == method)]
            _draw_phases(axis, runs, exponents, letter)
            axis.set_title(f'{problem}, {method}')
            slope = f': {letter}^{exponents["memory"].iloc[0]:.2f}' if len(exponents) else ''
            row[2].loglog(runs['size'], runs['MB at the end'] - runs['MB before'], 'o-', markersize=3, label=method + slope)
        row[2].set_title(f'{problem}, peak memory')
        row[2].set_ylabel('MB')
        for axis in row:
            axis.set_xlabel('elements N' if letter == 'N' else 'tanks S')
            axis.set_xticks(sizes, sizes)
            axis.minorticks_off()
            if axis.get_legend_handles_labels()[0]:
                axis.legend(fontsize=8, loc='upper left')
            axis.grid(True, alpha=0.2)
    return figure


def _draw_phases(axis, runs, exponents, letter):
    for phase in PHASES:
        if phase in exponents and np.isfinite(exponents[phase]).any():
            label = f'{phase}: {letter}^{exponents[phase].iloc[0]:.2f}'
            axis.loglog(runs['size'], runs[phase], 'o-', linewidth=2.5 if phase == 'total' else 1.2, markersize=3, label=label)
    axis.set_ylabel('time (s)')


def main():
    """Measure the missing rows, fit the exponents and draw the picture."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument('--only', choices=SIZES, action='append', help="a problem")
    options.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    options.add_argument('--run', nargs=3, metavar=('PROBLEM', 'SIZE', 'METHOD'), help=argparse.SUPPRESS)
    chosen = options.parse_args()
    if chosen.run:
        problem, size, method = chosen.run
        print(json.dumps(run(problem, int(size), method), default=str))
        return
    table = pd.read_csv(measure(chosen.only or SIZES, chosen.fresh))
    fits = fit(table)
    fits.to_csv(HERE / 'summary.csv', index=False, float_format='%.3f')
    draw(table, fits).savefig(HERE / 'summary.png', dpi=120)
    print(fits.to_string(index=False, float_format='{:.2f}'.format))


if __name__ == '__main__':
    main()
