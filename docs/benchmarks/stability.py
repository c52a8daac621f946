"""Where methods fail: every hard case with ours, a fixed grid, smoothing and nosnoc 0.2.0, judged from outside.

    .venv/bin/pip install nosnoc==0.2.0
    .venv/bin/python docs/benchmarks/stability.py [--fresh] [--only TEXT] [--methods NAME ...] [--limit SECONDS]

Writes stability.csv (every run), stability_shares.csv (the table) and stability.png beside this file.  Rows that are there already
are not run again, unless --fresh.
"""

import argparse
import csv
import re
import sys
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1]), str(HERE.parents[1] / 'examples'), str(HERE.parents[1] / 'tests')]

from stability_cases import CLASSES  # noqa: E402
from stability_others import others  # noqa: E402
from stability_problems import cases  # noqa: E402
from stability_worker import Worker  # noqa: E402

METHODS = ('mpec_hybrid', 'simulate', 'fixed grid', 'smoothing', 'nosnoc')
COLUMNS = ('family', 'case', 'start', 'method', 'class', 'error', 'looks', 'said', 'seconds')
#: Starts of a family that are run before those of the next one.
BLOCK = 10
RUNS, SHARES, PICTURE = HERE / 'stability.csv', HERE / 'stability_shares.csv', HERE / 'stability.png'
COLORS = {'right': '#3a923a', 'refused': '#9ecae1', 'silently within 1 %': '#fdae6b', 'silently wrong': '#d62728'}


def key(row):
    """What makes a row one of its own."""
    return tuple(str(row[column]) for column in COLUMNS[:4])


def measure(options):
    """Run what is not in the table yet, and append it row by row."""
    everything = [*cases(), *others()]
    done = set()
    if RUNS.exists() and not options.fresh:
        done = {key(row) for row in csv.DictReader(RUNS.open())}
    worker = Worker(everything, options.limit)
    with RUNS.open('a' if done else 'w', newline='') as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator='\n')
        if not done:
            writer.writeheader()
        # some starts of every family, then some more
        for number, case in sorted(enumerate(everything), key=lambda pair: pair[1].seed // BLOCK):
            for method in METHODS:
                row = {'family': case.family, 'case': case.name, 'start': case.seed, 'method': method}
                if key(row) in done or not re.search(options.only, case.family) or method not in (options.methods or METHODS):
                    continue
                found = ('-', float('nan'), '', 'cannot be stated', 0.0)
                if method in case.methods():
                    found = worker.run(number, method)
                row |= dict(zip(COLUMNS[4:], found))
                row |= {'error': f"{row['error']:.1e}", 'seconds': f"{row['seconds']:.1f}"}
                writer.writerow(row)
                file.flush()
                show(row)
    worker.end()


def show(row):
    """One line of progress."""
    print(f"{row['family'][:26]:26} {row['case'][:44]:44} {row['start']:>3} {row['method']:12} {row['class']:20}"
          f" {row['error']:>8} {row['seconds']:>5}  {row['looks'] or row['said'][:60]}", flush=True)  # fmt: skip


def shares(runs):
    """Share of each class, per family and method, in percent; and what wrong answers look like most."""
    runs = runs[runs['class'] != '-']
    rows = []
    for (family, method), group in runs.groupby(['family', 'method'], sort=False):
        counts = group['class'].value_counts()
        wrong = group[group['class'].isin(CLASSES[2:])]
        looks = '; '.join(wrong['looks'].dropna().value_counts().index[:2])
        rows.append(
            {'family': family, 'method': method, 'runs': len(group)}
            | {name: round(100 * counts.get(name, 0) / len(group), 1) for name in CLASSES}
            | {'a wrong answer looks like': looks}
        )
    return pd.DataFrame(rows)


def unstated(runs):
    """The families and methods that cannot state any case."""
    return {pair for pair, group in runs.groupby(['family', 'method']) if (group['class'] == '-').all()}


def draw(table, unstated):
    """Stacked bars: one for each family and method."""
    families = list(dict.fromkeys(table['family']))
    figure = Figure(figsize=(12, 0.36 * len(families) + 1.4), layout='constrained')
    for axis, method in zip(figure.subplots(1, len(METHODS), sharey=True), METHODS):
        own = table[table['method'] == method].set_index('family').reindex(families)
        left = 0.0
        for name in CLASSES:
            part = own[name].fillna(0.0)
            axis.barh(families, part, left=left, color=COLORS[name], label=name)
            left = left + part
        for k, family in enumerate(families):
            if pd.isna(own.loc[family, 'runs']):
                text = '–' if (family, method) in unstated else 'not run'
                axis.text(50, k, text, ha='center', va='center', color='0.5')
        axis.set_title(method, fontsize='medium')
        axis.set_xlim(0, 100)
        axis.set_xlabel('% of runs')
    axis.set_ylim(len(families) - 0.4, -0.6)
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside upper center', ncols=len(CLASSES), frameon=False)
    return figure


def main():
    """Measure, write the table and the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--fresh', action='store_true')
    parser.add_argument('--only', default='')
    parser.add_argument('--methods', nargs='*')
    parser.add_argument('--limit', type=float, default=20.0)
    measure(parser.parse_args())
    runs = pd.read_csv(RUNS)
    table = shares(runs)
    table.to_csv(SHARES, index=False)
    draw(table, unstated(runs)).savefig(PICTURE, dpi=110)
    with pd.option_context('display.width', 250, 'display.max_rows', None, 'display.max_colwidth', 60):
        print(table.to_string(index=False))


if __name__ == '__main__':
    main()
