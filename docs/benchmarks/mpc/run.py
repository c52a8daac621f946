"""Closed loops of predictive control: time of each step, where its answer comes from, and the cost of the loop.

    .venv/bin/pip install nosnoc==0.2.0 idaes-pse
    .venv/bin/python docs/benchmarks/mpc/run.py [--only PLANT] [--method METHOD] [--steps 200]

Each loop is a process of its own.  Writes a file of steps for each of them, steps_PLANT_METHOD.csv, the summary rows.csv, and
draws summary.png.
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import pandas as pd
from benchmarks.common.processes import json_lines
from benchmarks.mpc.loops import ADVANCED, METHODS, run_loop
from matplotlib.figure import Figure

HERE = Path(__file__).parent
#: Seconds for one loop.
LIMIT = 5400
#: Lines of the methods; the time of each step of the first one is a point.
COLORS = {'pyomo_fesd': 'k', 'pyomo_fesd, levels=5': 'C8', 'pyomo_fesd, rise=0.1': 'C6', 'nosnoc 0.2.0': 'C9'}
COLORS |= {'smoothed on a fixed grid': '0.7', 'pyomo_fesd' + ADVANCED: 'C5', 'pyomo_fesd, levels=5' + ADVANCED: 'C5'}
#: Costs of loops that differ by more than this factor have a logarithmic axis.
WIDE = 5.0
#: Steps that all loops have made.
COMMON = 25
ORIGINS = ('correction', 'branch', 'simulated branch', 'full run', 'deadline', 'plan')


def file_of(plant, method):
    """The file of the steps of one loop."""
    name = method.split(' on ')[0].replace(', ', '_').replace(' 0.2.0', '').replace('=0.1', '').replace('=5', '').replace(' ', '_')
    return HERE / f'steps_{plant}_{name}.csv'


def summary(plant, method, table):
    """One row about a loop."""
    counts = table['origin'].value_counts()
    row = {'plant': plant, 'method': method, 'steps': len(table)} | {origin: int(counts.get(origin, 0)) for origin in ORIGINS}
    row |= {'certified': int(table['certified'].sum()), 'median ms': 1e3 * table['seconds'].median()}
    row |= {'max ms': 1e3 * table['seconds'].max()}
    row |= {
        'median CPU ms': 1e3 * table['cpu'].median(),
        'cost': table['cost'].sum(),
        f'cost, first {COMMON}': table['cost'][:COMMON].sum(),
    }
    row[f'median CPU ms, first {COMMON}'] = 1e3 * table['cpu'][:COMMON].median()
    if 'cpu of preparation' in table:
        row['median CPU ms, preparation'] = 1e3 * table['cpu of preparation'].median()
        row['median CPU ms, corrections'] = 1e3 * table['cpu'][table['origin'] == 'correction'].median()
    in_branch = table[(table['origin'] == 'branch') & (table['ipopt'] > 0)]
    for name, part in (('branch', in_branch), ('all', table[table['ipopt'] > 0])):
        row[f'CPU / Ipopt, {name}'] = (part['cpu'] / part['ipopt']).median() if len(part) else None
    return row


def draw():
    """Time of each step by its origin, and the cost of each loop so far."""
    tables = {(plant, method): pd.read_csv(file_of(plant, method)) for plant, method in METHODS if file_of(plant, method).exists()}
    plants = list(dict.fromkeys(plant for plant, _ in tables))
    figure = Figure(figsize=(4 * len(plants), 7), layout='constrained')
    axes = figure.subplots(2, len(plants), squeeze=False)
    shown = {}
    for column, plant in zip(axes.T, plants):
        times, costs = column
        ours = {method: table for (p, method), table in tables.items() if p == plant}
        for method, table in ours.items():
            (shown[method],) = costs.plot(table['cost'].cumsum(), color=COLORS[method], linewidth=1.2)
            if method != 'pyomo_fesd':
                times.semilogy(table.index, table['seconds'], linewidth=0.6, color=COLORS[method])
        for number, origin in enumerate(ORIGINS[1:]):
            some = ours['pyomo_fesd'][ours['pyomo_fesd']['origin'] == origin]
            (shown[f'pyomo_fesd: {origin}'],) = times.semilogy(some.index, some['seconds'], '.', markersize=4, color=f'C{number}')
        whole = [table['cost'].sum() for table in ours.values() if len(table) > COMMON]
        costs.set_yscale('log' if max(whole) > WIDE * min(whole) else 'linear')
        times.set(title=plant, ylabel='time of a step (s)')
        costs.set(xlabel='step', ylabel='cost of the loop so far')
    figure.legend(shown.values(), shown.keys(), loc='outside lower center', ncols=4, fontsize=8)
    figure.savefig(HERE / 'summary.png', dpi=150)


def main():
    """Run the chosen loops, then write the summary of all that have steps."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', help="one plant")
    parser.add_argument('--method', help="one method")
    parser.add_argument('--steps', type=int, default=200)
    parser.add_argument('--here', action='store_true', help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    for plant, method in METHODS:
        if chosen.only in (None, plant) and chosen.method in (None, method):
            if chosen.here:
                run_loop(plant, method, chosen.steps).to_csv(file_of(plant, method), float_format='%.5g')
                return
            began = time.perf_counter()
            _, status = json_lines(__file__, '--here', '--only', plant, '--method', method, '--steps', chosen.steps, limit=LIMIT)
            print(f"{plant}, {method}: {status}, {time.perf_counter() - began:.0f} s", flush=True)
    found = [summary(*key, pd.read_csv(file_of(*key))) for key in METHODS if file_of(*key).exists()]
    pd.DataFrame(found).to_csv(HERE / 'rows.csv', index=False, float_format='%.4g')
    draw()


if __name__ == '__main__':
    main()
