"""An IDAES flowsheet (a reactor with a saturating level controller) on more and more elements: time of each phase, and memory.

    python docs/benchmarks/idaes_size/run.py [--fresh] [--only 60]

Each size runs in a process of its own with a time limit.  Writes rows.csv and summary.png beside this file; sizes that have a row
are skipped.  Needs the extra [idaes].
"""

import argparse
import json
import resource
import sys
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import pandas as pd
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from matplotlib.figure import Figure

HERE = Path(__file__).parent
SIZES, NCP, LIMIT = (20, 60, 120, 400), 3, 200
#: Columns of seconds; 'march' is ``simulate``.
PHASES = ('build', 'discretise', 'initialise', 'march', 'solve')
COLUMNS = (
    *('elements', *(f'{phase} (s)' for phase in PHASES)),
    *('equations', 'pairs', 'status', 'largest error of a time (s)', 'memory (MB)'),
)


def measure(nfe):
    """One row: seconds of each phase, sizes, verdict, memory."""
    import idaes_level  # IDAES takes seconds to import
    import pyomo.environ as pyo

    import pyomo_fesd

    row, clock = {'elements': nfe}, perf_counter()

    def done(phase):
        nonlocal clock
        row[f'{phase} (s)'] = round(perf_counter() - clock, 3)
        clock = perf_counter()

    m = idaes_level.exact(idaes_level.build())
    done('build')
    idaes_level.move(m, nfe, NCP)
    done('discretise')
    idaes_level.specify(m)
    done('initialise')
    pyomo_fesd.simulate(m.fs)
    done('march')
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    done('solve')
    report, (exact, _) = pyomo_fesd.report(m), idaes_level.reference()
    found = idaes_level.changes(m)
    right = [c.now for c in found] == [c.now for c in exact]
    return row | {
        'equations': report['constraints'],
        'pairs': report['pairs'],
        'status': str(results.solver.termination_condition) if right else 'wrong switches',
        'largest error of a time (s)': max(abs(a.time - b.time) for a, b in zip(found, exact)) if right else None,
        'memory (MB)': resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }


def draw(table):
    """Seconds of each phase over the number of elements."""
    figure = Figure(figsize=(6, 4), layout='constrained')
    axis = figure.subplots()
    for phase in PHASES:
        axis.loglog(table['elements'], table[f'{phase} (s)'], 'o-', label='simulate' if phase == 'march' else phase)
    axis.set_xticks(table['elements'], table['elements'], minor=False)
    axis.set_xticks([], minor=True)
    axis.set_xlabel('elements')
    axis.set_ylabel('time (s)')
    axis.legend()
    return figure


def main():
    """Measure the missing rows and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', type=int, help="one number of elements")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--measure', type=int, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.measure:
        print(json.dumps(measure(chosen.measure)))
        return
    rows = Rows(HERE / 'rows.csv', ('elements',), COLUMNS, fresh=chosen.fresh)
    for nfe in SIZES if chosen.only is None else (chosen.only,):
        if (nfe,) not in rows:
            found, status = json_lines(__file__, '--measure', nfe, limit=LIMIT)
            row = found[-1] if found else {'elements': nfe, 'status': status}
            print(row, flush=True)
            rows.add(row)
    draw(pd.read_csv(rows.path).sort_values('elements')).savefig(HERE / 'summary.png', dpi=150)


if __name__ == '__main__':
    main()
