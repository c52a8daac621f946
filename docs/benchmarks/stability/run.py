"""Failures of methods: hard cases with pyomo_fesd, a fixed grid, smoothing and nosnoc 0.2.0, checked against known answers.

    .venv/bin/pip install nosnoc==0.2.0
    .venv/bin/python docs/benchmarks/stability/run.py [--fresh] [--only TEXT] [--methods NAME ...] [--limit SECONDS] [--summary]

Writes rows.csv (every run), summary.csv (shares of each class) and summary.png beside this file; runs that have a row are skipped.
"""

import argparse
import re
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import pandas as pd
from benchmarks.common.processes import Child, NoAnswer
from benchmarks.common.rows import Rows
from benchmarks.stability.cases import CLASSES, REFUSED, judge
from benchmarks.stability.families import all_cases
from benchmarks.stability.methods import METHODS
from matplotlib.figure import Figure

HERE = Path(__file__).parent
KEY = ('family', 'case', 'start', 'method')
COLUMNS = (*KEY, 'class', 'error', 'looks', 'said', 'seconds')
#: Starts of a family that run before those of the next one.
BLOCK = 10
#: Class of a case that a method cannot state.
UNSTATED = '-'
COLORS = {'right': '#3a923a', 'refused': '#9ecae1', 'silently within 1 %': '#fdae6b', 'silently wrong': '#d62728'}


# One run, in a child process


def serve(pipe, cases, limit):
    """Answer each (number of a case, method) with ``(class, error, description of a wrong answer, messages)``."""
    warnings.simplefilter('ignore')
    pipe.send('ready')
    while True:
        number, method = pipe.recv()
        # less than the limit of the child: a method that stops by itself says more
        outcome = cases[number].run(method, 0.8 * limit)
        if outcome is None:
            pipe.send((UNSTATED, float('nan'), '', 'cannot be stated'))
        else:
            pipe.send((*judge(cases[number], outcome), outcome.said))


def run(child, number, method, limit):
    """Run a case; no answer is a refusal."""
    started = time.perf_counter()
    child.send((number, method))
    try:
        found = child.receive(limit)
    except NoAnswer as reason:
        found = REFUSED, float('nan'), '', str(reason)
    return *found, time.perf_counter() - started


# All runs


def measure(chosen):
    """Run everything that has no row."""
    cases = list(all_cases())
    rows = Rows(HERE / 'rows.csv', KEY, COLUMNS, fresh=chosen.fresh)
    # fork: cases hold functions that cannot be pickled
    child = Child(serve, cases, chosen.limit, method='fork')
    # some starts of every family, then some more
    for number, case in sorted(enumerate(cases), key=lambda pair: pair[1].seed // BLOCK):
        if not re.search(chosen.only, case.family):
            continue
        for method in chosen.methods:
            key = (case.family, case.name, case.seed, method)
            if key not in rows:
                found = (UNSTATED, float('nan'), '', 'cannot be stated', 0.0)
                if method in case.methods():
                    found = run(child, number, method, chosen.limit)
                row = dict(zip(COLUMNS, (*key, *found)))
                row |= {'error': f"{row['error']:.1e}", 'seconds': f"{row['seconds']:.1f}"}
                rows.add(row)
                show(row)
    child.stop()


def show(row):
    """Print one line of progress."""
    print(f"{row['family'][:26]:26} {row['case'][:44]:44} {row['start']:>3} {row['method']:12} {row['class']:20}"
          f" {row['error']:>8} {row['seconds']:>5}  {row['looks'] or row['said'][:60]}", flush=True)  # fmt: skip


def shares(runs):
    """Share of each class in percent, by family and method, and the most frequent descriptions of wrong answers."""
    rows = []
    for (family, method), group in runs[runs['class'] != UNSTATED].groupby(['family', 'method'], sort=False):
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
    """Pairs of family and method of which no case can be stated."""
    return {pair for pair, group in runs.groupby(['family', 'method']) if (group['class'] == UNSTATED).all()}


def draw(table, unstated):
    """Stacked bars, one for each family and method."""
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
    """Measure the missing rows, write the table and the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--only', default='', help="families, by a regular expression")
    parser.add_argument('--methods', nargs='*', choices=METHODS, default=METHODS)
    parser.add_argument('--limit', type=float, default=20.0, help="seconds for each run")
    parser.add_argument('--summary', action='store_true', help="run nothing")
    chosen = parser.parse_args()
    if not chosen.summary:
        measure(chosen)
    runs = pd.read_csv(HERE / 'rows.csv')
    table = shares(runs)
    table.to_csv(HERE / 'summary.csv', index=False)
    draw(table, unstated(runs)).savefig(HERE / 'summary.png', dpi=110)
    with pd.option_context('display.width', 250, 'display.max_rows', None, 'display.max_colwidth', 60):
        print(table.to_string(index=False))


if __name__ == '__main__':
    main()
