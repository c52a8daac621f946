"""Accuracy against time: problems x methods, one row for each run.

    .venv/bin/pip install nosnoc==0.2.0
    .venv/bin/python docs/benchmarks/work_precision/run.py [--only tank,nosnoc] [--limit 20] [--fresh] [--summary]

Each run appends a row to rows.csv beside this file; runs that have a row are skipped (``--fresh`` deletes the rows first).  At the
end, or at once with ``--summary``, the pictures are drawn and the targets printed.  A run happens in a child process, which is
replaced when it dies or hangs.  The runs are listed in runs.py, the problems in systems.py and docs/benchmarks/ocp, the methods in
pyomo_methods.py, nosnoc_peer.py and scipy_peer.py.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.common.processes import Child, NoAnswer
from benchmarks.common.rows import Rows
from benchmarks.work_precision import charts, targets
from benchmarks.work_precision.runs import RUNS, Run
from benchmarks.work_precision.worker import COLUMNS, serve

HERE = Path(__file__).parent
#: Seconds beyond the limit, for runs that are repeated and methods without a limit of their own.
GRACE = 60


def row_of(child, run, limit):
    """The row of one run, even if the child dies or hangs."""
    child.send((run, limit))
    try:
        return child.receive(limit + GRACE)
    except NoAnswer as reason:
        return run._asdict() | {'status': str(reason), 'claimed': False}


def study(only, limit, fresh):
    """Run everything that has no row."""
    rows = Rows(HERE / 'rows.csv', Run._fields, COLUMNS, digits=4, fresh=fresh)
    runs = [run for run in RUNS if run not in rows and (not only or {run.problem, run.method} & only)]
    child = Child(serve)
    for k, run in enumerate(runs):
        row = row_of(child, run, limit)
        rows.add(row)
        shown = f"{row.get('total', float('nan')):6.2f} s  error {row.get('error', float('nan')):.1e}  {row['status'][:60]}"
        print(f'{k + 1}/{len(runs)}', *(part for part in run if part), shown, flush=True)
    child.stop()


def main():
    """Run the missing rows, then draw the pictures and check the targets."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', type=lambda text: set(text.split(',')), help="problems or methods, by name")
    parser.add_argument('--limit', type=float, default=20.0, help="seconds for each run")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--summary', action='store_true', help="run nothing")
    chosen = parser.parse_args()
    if not chosen.summary:
        study(chosen.only, chosen.limit, chosen.fresh)
    table = charts.read(HERE / 'rows.csv')
    charts.draw_all(table, HERE)
    targets.write(table, HERE / 'targets.csv')


if __name__ == '__main__':
    main()
