"""Flowsheet (b), the reactor with a saturating level controller, on more and more elements: time of each phase, and memory.

    python docs/benchmarks/idaes_size.py [--fresh] [--only 60]

Each size runs in a process of its own with a time limit; finished rows stay in ``idaes_size.csv`` and are skipped in the next run.
Needs the extra [idaes].
"""

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import pandas as pd
from matplotlib.figure import Figure

HERE = Path(__file__).parent
TABLE, PICTURE = HERE / 'idaes_size.csv', HERE / 'idaes_size.png'
SIZES, NCP, LIMIT = (20, 60, 120, 400), 3, 200
PHASES = ('build', 'discretise', 'initialise', 'march', 'solve')


def measure(nfe):
    """One size: seconds of each phase, sizes, verdict, memory."""
    sys.path[:0] = [str(HERE.parents[1]), str(HERE.parents[1] / 'examples')]
    import idaes_level
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
    report, (known, _) = pyomo_fesd.report(m), idaes_level.reference()
    found = idaes_level.changes(m)
    right = [c.now for c in found] == [c.now for c in known]
    worst = max(abs(a.time - b.time) for a, b in zip(found, known)) if right else None
    return row | {
        'equations': report['constraints'],
        'pairs': report['pairs'],
        'status': str(results.solver.termination_condition) if right else 'wrong switches',
        'largest error of a time (s)': worst,
        'memory (MB)': resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }


def in_own_process(nfe):
    """The row of one size; its status says so if it fails or takes too long."""
    try:
        run = subprocess.run([sys.executable, __file__, '--measure', str(nfe)], capture_output=True, text=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return {'elements': nfe, 'status': f'more than {LIMIT} s'}
    lines = run.stdout.strip().splitlines()
    return json.loads(lines[-1]) if run.returncode == 0 and lines else {'elements': nfe, 'status': f'failed: {run.stderr[-200:]}'}


def draw(table):
    """Seconds of each phase over the number of elements."""
    figure = Figure(figsize=(6, 4), layout='constrained')
    axis = figure.subplots()
    for phase in PHASES:
        axis.loglog(table['elements'], table[f'{phase} (s)'], 'o-', label=phase)
    axis.set_xticks(table['elements'], table['elements'], minor=False)
    axis.set_xticks([], minor=True)
    axis.set_xlabel('elements')
    axis.set_ylabel('time (s)')
    axis.legend()
    figure.savefig(PICTURE, dpi=150)


def main():
    """The table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--measure', type=int)
    parser.add_argument('--only', type=int)
    parser.add_argument('--fresh', action='store_true')
    asked = parser.parse_args()
    if asked.measure:
        return print(json.dumps(measure(asked.measure)))
    table = pd.read_csv(TABLE) if TABLE.exists() and not asked.fresh else pd.DataFrame({'elements': []})
    for nfe in SIZES if asked.only is None else (asked.only,):
        if nfe in set(table['elements']):
            continue
        row = in_own_process(nfe)
        print(row, flush=True)
        table = pd.concat([table, pd.DataFrame([row])]).sort_values('elements').convert_dtypes()
        table.to_csv(TABLE, index=False)
    if {f'{phase} (s)' for phase in PHASES} <= set(table.columns):
        draw(table)


if __name__ == '__main__':
    main()
