"""MPCC collections by ``mpec_hybrid`` and three plain methods, with success checked independently of the solver.

    .venv/bin/python docs/benchmarks/mpcc/run.py FOLDER [--out NAME.csv] [--limit 300] [--only a,b] [--methods hybrid,scholtes]
                                                 [--largest BYTES] [--summary]
    .venv/bin/python docs/benchmarks/mpcc/run.py FOLDER --methods "hybrid;hybrid:relaxation=l1;hybrid:lpec=full,starts=8"

FOLDER holds instances (``*.json``, mpcc-json) or folders of them; their reader ``mpcc_json.py`` is in it or beside it.  The
instances are not part of this project.  Each run (instance, method) appends a row to FOLDER.csv beside this file; runs that have
a row are skipped.  A method may be ``hybrid`` with options of mpec_hybrid.  At the end, or at once with --summary, tables and
picture are made of the rows (see summary.py).  Each run happens in a child process, which is replaced when it dies or hangs.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.common.processes import Child, NoAnswer
from benchmarks.common.rows import Rows
from benchmarks.mpcc import summary
from benchmarks.mpcc.worker import COLUMNS, METHODS, serve, split_methods

HERE = Path(__file__).parent
#: Seconds that a child may use beyond the limit, for the model and its compilation; and for the check after it.
GRACE = 300


def run(child, path, method, limit):
    """The row of one run, even if the child dies or hangs."""
    row = {'set': path.parent.name, 'instance': path.stem, 'method': method, 'status': 'no answer'}
    child.send((str(path), method, limit))
    for seconds, phase in ((limit + GRACE, 'run'), (GRACE, 'check')):
        try:
            row = child.receive(seconds)
        except NoAnswer as reason:
            return row | {'error': f'{phase}: {reason}'}
    return row


def folders(folder):
    """``folder`` itself, or its sub-folders, if they hold instances."""
    if any(folder.glob('*.json')):
        return [folder]
    return sorted(f for f in folder.iterdir() if f.is_dir() and any(f.glob('*.json')))


def instances(folder, largest, only):
    """Instance files of at most ``largest`` bytes, small ones first; those named in ``only``, if given."""
    sizes = {p: p.stat().st_size for p in folder.glob('*.json') if not only or p.stem in only}
    return sorted((p for p in sizes if sizes[p] <= largest), key=lambda p: (sizes[p], p.name))


def study(folder, out, chosen):
    """Run everything that has no row in ``out``."""
    rows = Rows(out, ('set', 'instance', 'method'), COLUMNS, digits=9)
    paths = instances(folder, chosen.largest, chosen.only)
    runs = [(p, method) for p in paths for method in chosen.methods if (folder.name, p.stem, method) not in rows]
    child = Child(serve)
    for k, (path, method) in enumerate(runs):
        row = run(child, path, method, chosen.limit)
        rows.add(row)
        shown = [row.get(name, '') for name in ('status', 'solved', 'b_stationary', 'error')]
        print(f'{k + 1}/{len(runs)}', path.stem, method, *shown, f"{row.get('time', float('nan')):.2f} s", flush=True)
    child.stop()


def main():
    """Run the missing rows, then summarise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('--out', type=Path, help="default: FOLDER.csv beside this file")
    parser.add_argument('--limit', type=float, default=300.0, help="seconds for each run")
    parser.add_argument('--only', type=lambda text: text.split(','), help="instances, by name")
    parser.add_argument('--methods', type=split_methods, default=list(METHODS))
    parser.add_argument('--largest', type=float, default=float('inf'), help="leave out larger instance files (bytes)")
    parser.add_argument('--summary', action='store_true', help="run nothing")
    chosen = parser.parse_args()
    folder = chosen.folder.resolve()
    sys.path[:0] = [str(folder), str(folder.parent)]
    for part in folders(folder):
        out = chosen.out or HERE / f'{part.name}.csv'
        if not chosen.summary:
            study(part, out, chosen)
        summary.write(out)


if __name__ == '__main__':
    main()
