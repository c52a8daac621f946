"""Random switching systems against event-located solutions: every answer of ``simulate`` and ``mpec_hybrid`` is judged.

    .venv/bin/python docs/benchmarks/random_systems/run.py [--count N] [--only TEXT] [--methods NAME ...] [--limit S] [--fresh]

Writes rows.csv (every run) and summary.csv (verdicts by kind) beside this file; runs that have a row are skipped.
"""

import argparse
import re
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import pandas as pd
from benchmarks.common.processes import Child, NoAnswer, silence_output
from benchmarks.common.rows import Rows
from benchmarks.random_systems.generate import KINDS, draw
from benchmarks.random_systems.judge import METHODS, REFUSED, VERDICTS, run

HERE = Path(__file__).parent
KEY = ('kind', 'seed', 'method')
COLUMNS = (*KEY, 'events', 'nfe', 'verdict', 'error', 'seconds', 'said')


def serve(pipe, limit):
    """Answer each (kind, seed, method) with the cells of its row."""
    warnings.simplefilter('ignore')
    silence_output()
    pipe.send('ready')
    while True:
        kind, seed, method = pipe.recv()
        system, found = draw(kind, seed)
        started = time.perf_counter()
        verdict, error, said = run(system, found, method, limit)
        seconds = time.perf_counter() - started
        pipe.send(
            {'events': len(found.times), 'nfe': system.nfe, 'verdict': verdict, 'error': error, 'seconds': seconds, 'said': said}
        )


def measure(chosen):
    """Run everything that has no row; the kinds take turns, so that a part of the study has all of them."""
    rows = Rows(HERE / 'rows.csv', KEY, COLUMNS, digits=3, fresh=chosen.fresh)
    kinds = [kind for kind in KINDS if re.search(chosen.only, kind)]
    runs = [(kind, seed, method) for seed in range(-(-chosen.count // len(KINDS))) for kind in kinds for method in chosen.methods]
    child = Child(serve, chosen.limit)
    missing = [key for key in runs if key not in rows]
    for number, key in enumerate(missing, start=1):
        child.send(key)
        try:
            found = child.receive(2 * chosen.limit + 30)
        except NoAnswer as reason:
            found = {'verdict': REFUSED, 'said': str(reason)}
        rows.add(dict(zip(KEY, key)) | found)
        if found['verdict'] != 'right' or number % 50 == 0:
            print(f"{number}/{len(missing)} {key}: {found['verdict']} {found.get('error', '')} {found['said'][:140]}", flush=True)
    child.stop()


def summary(rows):
    """Verdicts by kind and method, and the longest time."""
    counts = rows.groupby(['kind', 'method', 'verdict'], sort=False).size().unstack(fill_value=0)
    counts = counts.reindex(columns=list(VERDICTS), fill_value=0)
    groups = rows.groupby(['kind', 'method'], sort=False)
    table = counts.loc[list(groups.groups)] if len(counts) else counts
    table.insert(0, 'systems', groups.size())
    table['median error'] = groups['error'].median().map('{:.0e}'.format)
    table['median s'] = groups['seconds'].median().round(2)
    table['longest s'] = groups['seconds'].max().round(1)
    total = table.groupby('method')[['systems', *VERDICTS]].sum()
    total.index = pd.MultiIndex.from_tuples([('all', method) for method in total.index], names=['kind', 'method'])
    return pd.concat([table, total]).astype({name: int for name in ('systems', *VERDICTS)})


def main():
    """Measure the missing rows, write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--count', type=int, default=1200, help="systems")
    parser.add_argument('--only', default='', help="kinds, by a regular expression")
    parser.add_argument('--methods', nargs='*', choices=METHODS, default=list(METHODS))
    parser.add_argument('--limit', type=float, default=20.0, help="seconds for each run")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    chosen = parser.parse_args()
    measure(chosen)
    table = summary(pd.read_csv(HERE / 'rows.csv'))
    table.to_csv(HERE / 'summary.csv')
    print(table.to_string())


if __name__ == '__main__':
    main()
