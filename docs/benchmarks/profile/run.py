"""Profile: which part of the package uses the seconds of nine workloads, and their memory.

    .venv/bin/python docs/benchmarks/profile/run.py --label before [--macmpec FOLDER] [--only WORKLOAD] [--fresh]

Appends a row of CPU seconds for each workload to rows.csv, the medians of its runs, and draws summary.png; workloads that have a
row of this label are skipped.  Each workload is a process of its own; ``memory`` is the most that it used, in MB.  FOLDER holds the
instances of MacMPEC (see docs/benchmarks/mpcc).
"""

import argparse
import gc
import json
import os
import resource
import statistics
import sys
from pathlib import Path

# CPU seconds are compared: the BLAS in casadi's wheel spins in a thread for each core, which gains nothing
os.environ.setdefault('OMP_NUM_THREADS', '1')
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import pandas as pd
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from benchmarks.profile.clock import Clock, CpuTimer, NlpClock
from benchmarks.profile.workloads import workloads
from matplotlib.figure import Figure

HERE = Path(__file__).parent
#: Seconds for one workload, with all its runs.
LIMIT = 600
#: Parts of the total, in the order of a run; 'other' is the algorithm itself, and loading of the results.
PARTS = (
    *('build', 'initialise', 'transform', 'march', 'write', 'import', 'derivatives', 'evaluations', 'linear algebra'),
    *('LPEC', 'review', 'other'),
)
COLUMNS = ('workload', 'label', 'runs', 'memory', 'total', *PARTS)
#: Parts that the timer of ``mpec_hybrid`` measures -> the paths of its phases, added, and those inside them, subtracted.
PHASES = {
    'march': ([('simulate',)], []),
    'write': ([('compile', 'read')], []),
    'import': ([('compile',), ('refresh',)], [('compile', 'read')]),
    'LPEC': ([('lpec',)], []),
    'review': ([('review',)], []),
}
WARM_UP = 'signum'


def measure(workload):
    """CPU seconds of each part of one run, and their total."""
    gc.collect()
    timer, nlp = CpuTimer(), NlpClock()
    clock = Clock(timer, nlp)
    with nlp.running():
        workload(clock, timer)
    found = dict.fromkeys(PARTS, 0.0) | clock.seconds
    solve = found.pop('solve')
    for part, (added, inside) in PHASES.items():
        found[part] += sum(timer.cpu.get(path, 0.0) for path in added) - sum(timer.cpu.get(path, 0.0) for path in inside)
    found['derivatives'] = timer.cpu.get(('build',), 0.0) + nlp.making
    found['evaluations'] = nlp.evaluating
    found['linear algebra'] = nlp.solving - nlp.evaluating
    inside = sum(found[part] for part in PARTS[PARTS.index('write') :]) + timer.cpu.get(('simulate',), 0.0)
    found['other'] = solve - inside
    return found | {'total': sum(found.values())}


def medians(name, instances):
    """The row of one workload without its label; a small workload runs first, so that no run pays for imports."""
    known = workloads(instances)
    runs, workload = known[name]
    measure(known[WARM_UP][1])
    rows = [measure(workload) for _ in range(runs)]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    found = {part: statistics.median(row[part] for row in rows) for part in ('total', *PARTS)}
    return {'workload': name, 'runs': runs, 'memory': memory} | found


def draw(table):
    """Stacked bars: the share of each part in the first label's total, for each workload and label."""
    names, labels = list(dict.fromkeys(table['workload'])), list(dict.fromkeys(table['label']))
    figure = Figure(figsize=(9, 1.2 + 0.42 * len(table)), layout='constrained')
    axis = figure.subplots()
    rows = [
        (k, j, table[(table['workload'] == n) & (table['label'] == b)]) for k, n in enumerate(names) for j, b in enumerate(labels)
    ]
    rows = [(k + 0.36 * (j - (len(labels) - 1) / 2), row.iloc[0]) for k, j, row in rows if len(row)]
    first = {name: table[table['workload'] == name]['total'].iloc[0] for name in names}
    heights, left = [y for y, _ in rows], [0.0] * len(rows)
    for number, part in enumerate(PARTS):
        widths = [max(row[part], 0.0) / first[row['workload']] for _, row in rows]
        axis.barh(heights, widths, 0.32, left, label=part, color=f'C{number % 10}', hatch='//' if number > 9 else None)
        left = [a + b for a, b in zip(left, widths)]
    for y, end, (_, row) in zip(heights, left, rows):
        axis.text(end + 0.01, y, f"{row['label']}: {row['total']:.3g} s", va='center', fontsize=8)
    axis.set_yticks(range(len(names)), names)
    axis.invert_yaxis()
    axis.set_xlim(0, max(1.2, 0.2 + max(row['total'] / first[row['workload']] for _, row in rows)))
    axis.set_xlabel(f"CPU time, {labels[0]} = 1")
    figure.legend(loc='outside lower center', ncols=6, fontsize=8)
    return figure


def main():
    """Measure the missing rows and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--label', default='now', help="of the rows, e.g. before or after")
    parser.add_argument('--macmpec', type=Path, help="folder of the instances of MacMPEC")
    parser.add_argument('--only', help="one workload")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--measure', help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    instances = chosen.macmpec and chosen.macmpec.resolve()
    if chosen.measure:
        print(json.dumps(medians(chosen.measure, instances)))
        return
    rows = Rows(HERE / 'rows.csv', ('workload', 'label'), COLUMNS, digits=4, fresh=chosen.fresh)
    folder = () if instances is None else ('--macmpec', instances)
    for name in workloads(instances) if chosen.only is None else (chosen.only,):
        if (name, chosen.label) not in rows:
            found, status = json_lines(__file__, '--measure', name, *folder, limit=LIMIT)
            print(name, found or status, flush=True)
            if found:
                rows.add(found[-1] | {'label': chosen.label})
    draw(pd.read_csv(rows.path)).savefig(HERE / 'summary.png', dpi=150)


if __name__ == '__main__':
    main()
