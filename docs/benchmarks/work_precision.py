"""Accuracy against time: problems x methods, one row for each run.

    .venv/bin/pip install nosnoc==0.2.0
    .venv/bin/python docs/benchmarks/work_precision.py [--only tank,nosnoc] [--limit 20] [--fresh] [--summary]

Each run appends a row to work_precision.csv beside this file, and no run is done twice (``--fresh`` begins anew).  At the end, or
at once with ``--summary``, the pictures are drawn and the targets printed.  A run happens in a child process, which is replaced
when it dies or hangs.  The table of runs is in wp_table.py, the problems in wp_systems.py and ocp_*.py, the methods in
wp_pyomo.py, wp_nosnoc.py and wp_events.py.
"""

import argparse
import csv
import multiprocessing
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

import wp_charts  # noqa: E402
import wp_targets  # noqa: E402
from wp_table import RUNS, Run  # noqa: E402
from wp_worker import COLUMNS, serve  # noqa: E402

CSV = HERE / 'work_precision.csv'
#: Seconds for a child to begin, and beyond the limit for three times what has no limit of its own.
GRACE = 60


class Worker:
    """A child process that does one run after the other."""

    def __init__(self):
        self._process = None

    def row(self, run, limit):
        """The row of one run, whatever happens to the child."""
        if self._process is None:
            self._start()
        self._pipe.send((run, limit))
        try:
            if self._pipe.poll(limit + GRACE):
                return self._pipe.recv()
            status = f'stopped after {limit + GRACE:g} s'
        except EOFError:
            status = 'the process died'
        self.stop()
        return run._asdict() | {'status': status, 'claimed': False}

    def _start(self):
        context = multiprocessing.get_context('spawn')
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self._pipe.recv()

    def stop(self):
        """End the child."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None


def key(run):
    """A run as the table's cells spell it."""
    return tuple(map(str, run))


def short(value):
    """Numbers without their noise."""
    return f'{value:.6g}' if isinstance(value, float) else value


def read_done():
    """Runs that the file holds."""
    if not CSV.exists():
        return set()
    with CSV.open(newline='') as stream:
        return {tuple(row[name] for name in Run._fields) for row in csv.DictReader(stream)}


def study(only, limit):
    """All runs that are missing."""
    done = read_done()
    runs = [run for run in RUNS if key(run) not in done and (not only or {run.problem, run.method} & only)]
    worker = Worker()
    with CSV.open('a', newline='') as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        if stream.tell() == 0:
            writer.writeheader()
        for k, run in enumerate(runs):
            row = worker.row(run, limit)
            writer.writerow(
                {name: f'{v:.4g}' if isinstance(v, float) and name not in Run._fields else v for name, v in row.items()}
            )
            stream.flush()
            said = f"{row.get('total', float('nan')):6.2f} s  error {row.get('error', float('nan')):.1e}  {row['status'][:60]}"
            print(f'{k + 1}/{len(runs)}', *(part for part in run if part), said, flush=True)
    worker.stop()


def main():
    """Run what is missing, then draw and judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', type=lambda text: set(text.split(',')), help="problems or methods, by name")
    parser.add_argument('--limit', type=float, default=20.0, help="seconds for each run")
    parser.add_argument('--fresh', action='store_true', help="forget the rows that are there")
    parser.add_argument('--summary', action='store_true', help="run nothing")
    arguments = parser.parse_args()
    if arguments.fresh:
        CSV.unlink(missing_ok=True)
    if not arguments.summary:
        study(arguments.only, arguments.limit)
    table = wp_charts.read(CSV)
    wp_charts.draw_all(table, HERE)
    wp_targets.tell(table, HERE / 'work_precision_targets.csv')


if __name__ == '__main__':
    main()
