"""``pyomo_fesd.simulate`` beside scipy with hand-coded events and slides: time of each phase, error, growth with N.

    .venv/bin/python docs/benchmarks/march.py [--fresh] [--only tank]

Every row is a child process with a time limit; medians of several runs in it.  Finished rows are kept in march.csv and skipped;
``march.png`` is drawn from them.  Times are those of the machine at hand: read the ratios to scipy's fastest run that is right to
1e-8.
"""

import argparse
import json
import logging
import statistics
import subprocess
import sys
from pathlib import Path
from time import perf_counter

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / 'examples'), str(HERE.parents[1])]

import gas_liquid_tank  # noqa: E402
import numpy as np  # noqa: E402
import oscillator  # noqa: E402
import pandas as pd  # noqa: E402
import pyomo.environ as pyo  # noqa: E402
import scale_cascade  # noqa: E402
import thermostat  # noqa: E402
from march_peers import (  # noqa: E402
    cascade_by_hand,
    oscillator_by_hand,
    tank_by_hand,
    thermostat_by_hand,
    thermostat_end,
)
from matplotlib.figure import Figure  # noqa: E402
from pyomo.common.timing import HierarchicalTimer  # noqa: E402

import pyomo_fesd  # noqa: E402

TABLE, PICTURE = HERE / 'march.csv', HERE / 'march.png'
NUMBERS, REPEATS, LIMIT = (12, 25, 50, 100, 200, 400), 3, 300
#: method -> number of Radau's points
OURS = {'simulate, K = 3': 3, 'simulate, K = 4': 4}
TOLERANCES, METHODS, TARGET = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11), ('RK45', 'DOP853', 'LSODA'), 1e-8
TANKS = 20
#: Hours of the thermostat.
HOURS = 2.8
KEYS = ['problem', 'method', 'N', 'tolerance']


def error_of_tank(m):
    found, exact = gas_liquid_tank.found(m), gas_liquid_tank.EXACT
    return max(abs(found[name] / exact[name] - 1) for name in ('t_s', 'M_G'))


def error_of_oscillator(m):
    (switch,) = pyomo_fesd.switches(m)
    return max(abs(switch.time - oscillator.SWITCH), oscillator.error(m))


def error_of_thermostat(m):
    times, exact = [s.time for s in pyomo_fesd.switches(m)], thermostat.switching_times(HOURS)
    wrong = float('inf') if len(times) != len(exact) else max(np.abs(np.subtract(times, exact)))
    return max(wrong, abs(m.y[HOURS].value - thermostat_end(HOURS)))


def error_of_cascade(m):
    times = sorted(s.time for s in pyomo_fesd.switches(m))
    exact = [t for t in scale_cascade.exact(TANKS) if t < scale_cascade.HORIZON]
    return float('inf') if len(times) != len(exact) else max(np.abs(np.subtract(times, exact)))


#: problem -> (model, memory, error of a solved model, the same by hand)
PROBLEMS = {
    'tank': (gas_liquid_tank.build, None, error_of_tank, tank_by_hand),
    'oscillator': (oscillator.build, None, error_of_oscillator, oscillator_by_hand),
    'thermostat': (lambda: thermostat.build(HOURS), 'relay', error_of_thermostat, lambda *a: thermostat_by_hand(*a, HOURS)),
    'cascade': (lambda: scale_cascade.build(TANKS), None, error_of_cascade, lambda *a: cascade_by_hand(*a, TANKS)),
}


def simulated(problem, N, K):
    """One simulation: seconds of its phases, and the error."""
    build, memory, error, _ = PROBLEMS[problem]
    clock = [perf_counter()]
    m = build()
    clock.append(perf_counter())
    pyo.TransformationFactory('fesd.dcs').apply_to(m, **({'memory': [m.component(memory)]} if memory else {}))
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=N, ncp=K)
    clock.append(perf_counter())
    timer = HierarchicalTimer()
    pyomo_fesd.simulate(m, timer=timer)
    clock.append(perf_counter())
    whole = timer.timers['simulate'].timers
    march, begin = whole['march'].timers, whole['march'].timers['begin'].timers
    seconds = {
        'model': clock[1] - clock[0],
        'transformations': clock[2] - clock[1],
        'read': whole['read'].total_time + march['read'].total_time,
        'compile': sum(found['compile'].total_time for found in (march, begin) if 'compile' in found),
        'review': whole['review'].total_time,
        'trajectory': whole['trajectory'].total_time,
        'total': clock[3] - clock[0],
    }
    seconds['march'] = whole['march'].total_time - march['read'].total_time - seconds['compile']
    counts = {'steps': march['smooth'].n_calls, 'windows': march['window'].n_calls if 'window' in march else 0}
    return seconds, {'error': error(m), **counts}


def row(problem, method, N, tolerance):
    """One row of the table."""
    if method in OURS:
        runs = [simulated(problem, N, OURS[method]) for _ in range(REPEATS)]
        return {name: statistics.median(s[name] for s, _ in runs) for name in runs[0][0]} | runs[-1][1]
    error, seconds = None, []
    for _ in range(REPEATS + 1):
        started = perf_counter()
        error = PROBLEMS[problem][3](method, tolerance)
        seconds.append(perf_counter() - started)
    return {'march': statistics.median(seconds[1:]), 'total': statistics.median(seconds[1:]), 'error': error}


def in_a_child(key):
    """The row in a process of its own; a failure is its status."""
    command = [sys.executable, __file__, '--row', json.dumps(key)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return {'status': f'more than {LIMIT} s'}
    if done.returncode:
        return {'status': (done.stderr.strip().splitlines() or ['failed'])[-1][:100]}
    return {'status': 'ok'} | json.loads(done.stdout.splitlines()[-1])


def wanted(only):
    """The keys of all rows."""
    for problem in PROBLEMS:
        if only in (None, problem):
            for method in METHODS:
                yield from ((problem, method, 0, tolerance) for tolerance in TOLERANCES)
            yield from ((problem, method, N, 0.0) for method in OURS for N in NUMBERS)


def measure(only, fresh):
    """Fill the table."""
    if fresh:
        TABLE.unlink(missing_ok=True)
    table = pd.read_csv(TABLE) if TABLE.exists() else pd.DataFrame(columns=KEYS)
    done = set(table[KEYS].itertuples(index=False, name=None))
    for key in wanted(only):
        if key not in done:
            found = in_a_child(key)
            print(*key, found, flush=True)
            table = pd.concat([table, pd.DataFrame([dict(zip(KEYS, key)) | found])], ignore_index=True)
            table.to_csv(TABLE, index=False, float_format='%.6g')
    return table


def peer(table, problem):
    """Scipy's fastest run that is right to ``TARGET``."""
    right = table[(table['problem'] == problem) & (table['N'] == 0) & (table['error'] <= TARGET)]
    return right.loc[right['march'].idxmin()]


def summary(table):
    """For every problem our fastest march that is right to ``TARGET``, beside scipy; and how time grows with N for K = 3."""
    rows = []
    for problem in table['problem'].unique():
        ours = table[(table['problem'] == problem) & (table['N'] > 0) & (table['status'] == 'ok')]
        right, by_hand = ours[ours['error'] <= TARGET].sort_values('march'), peer(table, problem)
        large = ours[(ours['method'] == list(OURS)[0]) & (ours['N'] >= 25)]
        slopes = {w: np.polyfit(np.log(large['N'].astype(float)), np.log(large[w].astype(float)), 1)[0] for w in ('march', 'total')}
        best = None if right.empty else right.iloc[0]
        rows.append(
            {'problem': problem, 'scipy': f'{by_hand["method"]} {by_hand["tolerance"]:.0e}', 'scipy ms': 1e3 * by_hand['march']}
            | {'simulate': '-' if best is None else f'K = {OURS[best["method"]]}, N = {best["N"]:.0f}'}
            | {f'{w} / scipy': np.nan if best is None else best[w] / by_hand['march'] for w in ('march', 'total')}
            | {f'exponent of {what}': value for what, value in slopes.items()}
        )
    return pd.DataFrame(rows).set_index('problem')


def draw(table):
    """Error over time, and time over N."""
    problems = list(table['problem'].unique())
    figure = Figure(figsize=(4 * len(problems), 7), layout='constrained')
    axes = figure.subplots(2, len(problems), squeeze=False)
    for (accuracy, growth), problem in zip(axes.T, problems):
        own = table[(table['problem'] == problem) & (table['status'] == 'ok')]
        unit = peer(table, problem)['march']
        for method in METHODS:
            line = own[own['method'] == method].sort_values('error')
            accuracy.loglog(line['march'] / unit, line['error'].clip(lower=1e-15), '.-', color='0.7', label=None)
            accuracy.annotate(method, (line['march'].iloc[0] / unit, max(line['error'].iloc[0], 1e-15)), fontsize=7, color='0.4')
        for method, style in zip(OURS, ('o-', 's--')):
            ours = own[own['method'] == method].sort_values('N')
            for what, colour in (('march', 'C0'), ('total', 'C3')):
                accuracy.loglog(ours[what] / unit, ours['error'].clip(lower=1e-15), style, color=colour, label=f'{method}: {what}')
        ours = own[own['method'] == list(OURS)[0]].sort_values('N')
        accuracy.set(title=problem, xlabel="time / scipy's at 1e-8", ylabel='error')
        accuracy.axhline(TARGET, color='0.5', linewidth=0.6)
        accuracy.legend(fontsize=7)
        parts = ['march', 'compile', 'read', 'review', 'trajectory', 'transformations', 'model']
        growth.stackplot(ours['N'], [ours[part].astype(float) for part in parts], labels=parts)
        growth.set(xlabel='number of elements, K = 3', ylabel='s')
        growth.legend(fontsize=7, loc='upper left')
    figure.savefig(PICTURE, dpi=130)


def main():
    """Measure what is missing, say and draw what was found."""
    parser = argparse.ArgumentParser()
    parser.add_argument('--only', choices=list(PROBLEMS))
    parser.add_argument('--fresh', action='store_true')
    parser.add_argument('--row', help='one row, as JSON (used by the script itself)')
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)
    if arguments.row:
        print(json.dumps(row(*json.loads(arguments.row)), default=float))
        return
    table = measure(arguments.only, arguments.fresh)
    print(summary(table).to_string(float_format='{:.3g}'.format))
    draw(table)


if __name__ == '__main__':
    main()
