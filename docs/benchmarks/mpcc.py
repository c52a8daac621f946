"""MPCC collections by ``mpec_hybrid`` and three plain methods, with success judged from outside.

    python docs/benchmarks/mpcc.py FOLDER [--out NAME.csv] [--limit 300] [--only a,b] [--methods hybrid,scholtes]
                                          [--largest BYTES] [--summary]
    python docs/benchmarks/mpcc.py FOLDER --methods "hybrid;hybrid:relaxation=l1;hybrid:lpec=full,starts=8"

FOLDER holds instances (``*.json``, mpcc-json) or folders of them; their reader ``mpcc_json.py`` stands in it or beside it.  The
instances are no part of this project.  Each run (instance, method) appends a row to mpcc_FOLDER.csv beside this file, and no run
is done twice.  A method may be hybrid with options of mpec_hybrid.  At the end, or at once with --summary, the tables and the
picture are made of these rows (see mpcc_summary.py).  Each run happens in a child process, which is replaced when it dies or
hangs.
"""

import argparse
import csv
import multiprocessing
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

import mpcc_summary  # noqa: E402
from mpcc_worker import COLUMNS, METHODS, serve, split_methods  # noqa: E402

#: Seconds that a child may use beyond the limit, for the model and its compilation; and for the verdict after it.
GRACE = 300


class Worker:
    """A child process that runs one (path, method) after the other."""

    def __init__(self):
        self._process = None

    def run(self, path, method, limit):
        """The row of one run, whatever happens to the child."""
        if self._process is None or not self._process.is_alive():
            self._start()
        row = {'set': path.parent.name, 'instance': path.stem, 'method': method, 'status': 'no answer'}
        self._pipe.send((str(path), method, limit))
        for wait, what in ((limit + GRACE, 'run'), (GRACE, 'check')):
            try:
                if self._pipe.poll(wait):
                    row = self._pipe.recv()
                    continue
                problem = f'{what}: stopped after {wait:g} s'
            except EOFError:
                problem = f'{what}: the process died'
            row['error'] = problem
            self.stop()
            break
        return row

    def _start(self):
        context = multiprocessing.get_context('spawn')
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()

    def stop(self):
        """End the child."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None


def folders(folder):
    """``folder`` itself, or its sub-folders, if they hold instances."""
    if any(folder.glob('*.json')):
        return [folder]
    return sorted(f for f in folder.iterdir() if f.is_dir() and any(f.glob('*.json')))


def study(folder, out, arguments):
    """All runs that ``out`` does not hold yet, small instances first."""
    sizes = {p: p.stat().st_size for p in folder.glob('*.json')}
    paths = sorted((p for p in sizes if sizes[p] <= arguments.largest), key=lambda p: (sizes[p], p.name))
    if arguments.only:
        paths = [p for p in paths if p.stem in arguments.only]
    done = set()
    if out.exists():
        with out.open(newline='') as stream:
            done = {(r['set'], r['instance'], r['method']) for r in csv.DictReader(stream)}
    runs = [(p, method) for p in paths for method in arguments.methods if (folder.name, p.stem, method) not in done]
    worker = Worker()
    with out.open('a', newline='') as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        if stream.tell() == 0:
            writer.writeheader()
        for k, (path, method) in enumerate(runs):
            row = worker.run(path, method, arguments.limit)
            writer.writerow({name: f'{v:.9g}' if isinstance(v, float) else v for name, v in row.items()})
            stream.flush()
            said = [row.get(name, '') for name in ('status', 'solved', 'b_stationary', 'error')]
            print(f'{k + 1}/{len(runs)}', path.stem, method, *said, f"{row.get('time', float('nan')):.2f} s", flush=True)
    worker.stop()


def main():
    """Run what is missing, then summarise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--out', type=Path, help="default: mpcc_FOLDER.csv beside this file")
    parser.add_argument('--limit', type=float, default=300.0, help="seconds for each run")
    parser.add_argument('--only', type=lambda text: text.split(','), help="instances, by name")
    parser.add_argument('--methods', type=split_methods, default=list(METHODS))
    parser.add_argument('--largest', type=float, default=float('inf'), help="leave out larger instance files (bytes)")
    parser.add_argument('--summary', action='store_true', help="run nothing")
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    sys.path[:0] = [str(folder), str(folder.parent)]
    for part in folders(folder):
        out = arguments.out or HERE / f'mpcc_{part.name}.csv'
        if not arguments.summary:
            study(part, out, arguments)
        mpcc_summary.write(out)


if __name__ == '__main__':
    main()
