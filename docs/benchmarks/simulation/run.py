"""``pyomo_fesd.simulate`` beside scipy with hand-coded events and slides: time of each phase, error, growth with N.

    .venv/bin/python docs/benchmarks/simulation/run.py [--fresh] [--only tank]

Every row comes from a child process with a time limit and is the median of several runs.  Writes rows.csv and summary.png beside
this file; runs that have a row are skipped.  The column ``march`` has the seconds of the simulation itself, ``total`` those from
the empty model to the results.  Times are those of the machine at hand: compare the ratios to scipy's fastest run whose error is
at most 1e-8.
"""

import argparse
import json
import logging
import statistics
import sys
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import gas_liquid_tank
import numpy as np
import oscillator
import pandas as pd
import pyomo.environ as pyo
import thermostat
from benchmarks.common.exact import error_of_times, thermostat_temperature
from benchmarks.common.fits import exponent
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from benchmarks.scale import cascade
from benchmarks.simulation import scipy_peers as by_hand
from matplotlib.figure import Figure
from pyomo.common.timing import HierarchicalTimer

import pyomo_fesd

HERE = Path(__file__).parent
ROWS = HERE / 'rows.csv'
NUMBERS, REPEATS, LIMIT = (12, 25, 50, 100, 200, 400), 3, 300
#: method -> number of Radau points
OURS = {'simulate, K = 3': 3, 'simulate, K = 4': 4}
TOLERANCES, METHODS, TARGET = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11), ('RK45', 'DOP853', 'LSODA'), 1e-8
TANKS = 20
#: Horizon of the thermostat, hours.
HOURS = 2.8
KEY = ('problem', 'method', 'N', 'tolerance')
PHASES = ('march', 'compile', 'read', 'review', 'trajectory', 'transformations', 'model')
COLUMNS = (
    *(*KEY, 'status', 'march', 'total', 'error'),
    *('model', 'transformations', 'read', 'compile', 'review', 'trajectory', 'steps', 'windows'),
)


def error_of_tank(m, times):
    """Largest relative error of the switching time and the gas holdup at the end."""
    exact, found = gas_liquid_tank.EXACT, {'M_G': m.M_G[m.t.last()].value}
    return max(error_of_times(times, [exact['t_s']]) / exact['t_s'], abs(found['M_G'] / exact['M_G'] - 1))


def error_of_oscillator(m, times):
    """Largest error of the switching time and the end state."""
    return max(error_of_times(times, [oscillator.SWITCH]), oscillator.error(m))


def error_of_thermostat(m, times):
    """Largest error of the switching times and the temperature at the end."""
    error = error_of_times(times, thermostat.switching_times(HOURS))
    return max(error, abs(m.y[HOURS].value - thermostat_temperature(HOURS)))


def error_of_cascade(m, times):
    """Largest error of a switching time."""
    return error_of_times(times, cascade.exact(TANKS))


#: problem -> (build, Disjunction with hysteresis, error of a solved model, error of the peer)
PROBLEMS = {
    'tank': (gas_liquid_tank.build, None, error_of_tank, by_hand.tank_by_hand),
    'oscillator': (oscillator.build, None, error_of_oscillator, by_hand.oscillator_by_hand),
    'thermostat': (
        lambda: thermostat.build(HOURS),
        'relay',
        error_of_thermostat,
        lambda *settings: by_hand.thermostat_by_hand(*settings, HOURS),
    ),
    'cascade': (
        lambda: cascade.build(TANKS),
        None,
        error_of_cascade,
        lambda *settings: by_hand.cascade_by_hand(*settings, TANKS),
    ),
}


# One row, in its own process


def simulated(problem, N, K):
    """Simulate once; return the seconds of the phases, and error and counts."""
    build, hysteresis, error, _ = PROBLEMS[problem]
    clock = [perf_counter()]
    m = build()
    clock.append(perf_counter())
    if hysteresis:
        pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.component(hysteresis)])
    clock.append(perf_counter())
    timer = HierarchicalTimer()
    frame = pyomo_fesd.simulate(m, nfe=N, ncp=K, timer=timer)
    clock.append(perf_counter())
    whole = timer.timers['simulate'].timers
    march, begin = whole['march'].timers, whole['march'].timers['begin'].timers
    inside = {name: seconds_of(name, march) for name in ('read', 'review', 'trajectory')}
    seconds = {
        'model': clock[1] - clock[0],
        'transformations': clock[2] - clock[1] + whole['transform'].total_time,
        'compile': seconds_of('compile', march) + seconds_of('compile', begin),
        **{name: seconds_of(name, whole) + found for name, found in inside.items()},
        'total': clock[3] - clock[0],
    }
    seconds['march'] = whole['march'].total_time - seconds['compile'] - sum(inside.values())
    counts = {'steps': march['newton'].n_calls, 'windows': march['mpcc'].n_calls if 'mpcc' in march else 0}
    return seconds, {'error': error(m, [s.time for s in pyomo_fesd.switches(frame)]), **counts}


def seconds_of(name, timers):
    """Time of a phase; 0 where it was not needed."""
    return timers[name].total_time if name in timers else 0.0


def measured(problem, method, N, tolerance):
    """Medians of several runs."""
    if method in OURS:
        runs = [simulated(problem, N, OURS[method]) for _ in range(REPEATS)]
        return {name: statistics.median(s[name] for s, _ in runs) for name in runs[0][0]} | runs[-1][1]
    error, seconds = None, []
    for _ in range(REPEATS + 1):
        started = perf_counter()
        error = PROBLEMS[problem][3](method, tolerance)
        seconds.append(perf_counter() - started)
    return {'march': statistics.median(seconds[1:]), 'total': statistics.median(seconds[1:]), 'error': error}


# All rows


def runs(only=None):
    """The keys of all rows, or of those of one problem."""
    for problem in PROBLEMS:
        if only in (None, problem):
            for method in METHODS:
                yield from ((problem, method, 0, tolerance) for tolerance in TOLERANCES)
            yield from ((problem, method, N, 0.0) for method in OURS for N in NUMBERS)


def measure(only, fresh):
    """Measure the missing rows."""
    rows = Rows(ROWS, KEY, COLUMNS, fresh=fresh)
    for key in runs(only):
        if key not in rows:
            found, status = json_lines(__file__, '--row', json.dumps(key), limit=LIMIT)
            row = dict(zip(KEY, key)) | {'status': status} | (found[-1] if found else {})
            print(*row.values(), flush=True)
            rows.add(row)


def peer(table, problem):
    """Scipy's fastest run with an error of at most ``TARGET``."""
    right = table[(table['problem'] == problem) & (table['N'] == 0) & (table['error'] <= TARGET)]
    return right.loc[right['march'].idxmin()]


def summary(table):
    """For each problem our fastest run with an error of at most ``TARGET`` beside scipy's, and the growth of time with N, K = 3."""
    return pd.DataFrame([_summary_row(table, problem) for problem in table['problem'].unique()]).set_index('problem')


def _summary_row(table, problem):
    ours, theirs = table[(table['problem'] == problem) & (table['N'] > 0) & (table['status'] == 'ok')], peer(table, problem)
    right = ours[ours['error'] <= TARGET].sort_values('march')
    large = ours[(ours['method'] == list(OURS)[0]) & (ours['N'] >= 25)]
    best = None if right.empty else right.iloc[0]
    return (
        {'problem': problem, 'scipy': f'{theirs["method"]} {theirs["tolerance"]:.0e}', 'scipy ms': 1e3 * theirs['march']}
        | {'simulate': '-' if best is None else f'K = {OURS[best["method"]]}, N = {best["N"]:.0f}'}
        | {f'{time} / scipy': np.nan if best is None else best[time] / theirs['march'] for time in ('march', 'total')}
        | {f'exponent of {time}': exponent(large['N'], large[time]) for time in ('march', 'total')}
    )


def draw(table):
    """Error over time, and time over N."""
    problems = list(table['problem'].unique())
    figure = Figure(figsize=(4 * len(problems), 7), layout='constrained')
    for axes, problem in zip(figure.subplots(2, len(problems), squeeze=False).T, problems):
        own = table[(table['problem'] == problem) & (table['status'] == 'ok')]
        axes[0].set_title(problem)
        _draw_accuracy(axes[0], own, peer(table, problem)['march'])
        _draw_growth(axes[1], own[own['method'] == list(OURS)[0]].sort_values('N'))
    return figure


def _draw_accuracy(axis, rows, unit):
    for method in METHODS:
        line = rows[rows['method'] == method].sort_values('error')
        axis.loglog(line['march'] / unit, line['error'].clip(lower=1e-15), '.-', color='0.7', label=None)
        axis.annotate(method, (line['march'].iloc[0] / unit, max(line['error'].iloc[0], 1e-15)), fontsize=7, color='0.4')
    for method, style in zip(OURS, ('o-', 's--')):
        ours = rows[rows['method'] == method].sort_values('N')
        for time, colour in (('march', 'C0'), ('total', 'C3')):
            axis.loglog(ours[time] / unit, ours['error'].clip(lower=1e-15), style, color=colour, label=f'{method}: {time}')
    axis.set(xlabel="time / scipy's at 1e-8", ylabel='error')
    axis.axhline(TARGET, color='0.5', linewidth=0.6)
    axis.legend(fontsize=7)


def _draw_growth(axis, rows):
    axis.stackplot(rows['N'], [rows[phase].astype(float) for phase in PHASES], labels=PHASES)
    axis.set(xlabel='number of elements, K = 3', ylabel='s')
    axis.legend(fontsize=7, loc='upper left')


def main():
    """Measure the missing rows, print the summary and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', choices=PROBLEMS, help="one problem")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--row', type=json.loads, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    logging.disable(logging.WARNING)
    if chosen.row:
        print(json.dumps(measured(*chosen.row), default=float))
        return
    measure(chosen.only, chosen.fresh)
    table = pd.read_csv(ROWS)
    print(summary(table).to_string(float_format='{:.3g}'.format))
    draw(table).savefig(HERE / 'summary.png', dpi=130)


if __name__ == '__main__':
    main()
