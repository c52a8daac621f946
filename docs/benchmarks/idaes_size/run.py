"""An IDAES flowsheet (a reactor with a saturating level controller) on more and more elements: time and memory of each phase.

    python docs/benchmarks/idaes_size/run.py [--fresh] [--only 60]

Each run is in a process of its own with a time limit.  Writes rows.csv and summary.png beside this file; runs that have a row are
skipped.  Seconds are CPU seconds, memory is the largest until the end of the phase.  Needs the extra [idaes].
"""

import argparse
import json
import resource
import sys
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import pandas as pd
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from matplotlib.figure import Figure

HERE = Path(__file__).parent
#: Numbers of elements; the last one has 100,000 equations.
SIZES, NCP, LIMIT = (20, 120, 710), 3, 900
#: Columns of seconds; 'march' is ``simulate``, or IDAES' initialisation element by element.
PHASES = ('build', 'discretise', 'initialise', 'march', 'solve')
COLUMNS = (
    *('elements', 'variant', *(f'{phase} (s)' for phase in PHASES), *(f'{phase} (MB)' for phase in PHASES)),
    *('equations', 'pairs', 'status', 'largest error of a time (s)', 'error of the final volume (m3)'),
)
#: What is run, with the sizes for which it is.
VARIANTS = {
    'all calls': SIZES,
    'simulate, no grid': SIZES,
    'without review': SIZES[-1:],
    'without simulate': SIZES[-1:],
    'smooth, fixed grid': SIZES,
    'smooth, fixed grid, element by element': SIZES,
}


def measure(nfe, variant):
    """One row: seconds and memory of each phase, sizes, verdict."""
    import idaes_level  # IDAES takes seconds to import
    import pyomo.environ as pyo
    from idaes.core.util.initialization import initialize_by_time_element

    import pyomo_fesd

    row, clock = {'elements': nfe, 'variant': variant}, process_time()

    def done(phase):
        nonlocal clock
        row[f'{phase} (s)'] = round(process_time() - clock, 3)
        row[f'{phase} (MB)'] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
        clock = process_time()

    smooth, without_grid = variant.startswith('smooth'), variant == 'simulate, no grid'
    m = idaes_level.build() if smooth else idaes_level.exact(idaes_level.build())
    done('build')
    if smooth:
        pyo.TransformationFactory('dae.collocation').apply_to(m.fs, wrt=m.fs.time, nfe=nfe, ncp=NCP)
    elif not without_grid:
        idaes_level.move(m, nfe, NCP)
    done('discretise')
    idaes_level.specify(m)
    done('initialise')
    if smooth:
        ipopt = pyo.SolverFactory('casadi_ipopt')
        if 'element by element' in variant:
            initialize_by_time_element(m.fs, m.fs.time, solver=ipopt)
            done('march')
        results = ipopt.solve(m)
    elif without_grid:
        frame = pyomo_fesd.simulate(m.fs, m.fs.time, nfe=nfe, ncp=NCP)
        done('march')
    else:
        if variant != 'without simulate':
            pyomo_fesd.simulate(m.fs)
            done('march')
        options = {'warm_start': variant != 'without simulate', 'review': variant != 'without review'}
        results = pyo.SolverFactory('mpec_hybrid').solve(m, **options)
    exact, end = idaes_level.reference()
    row['error of the final volume (m3)'] = abs(m.fs.cstr.volume[m.fs.time.last()].value - end)
    if without_grid:
        row['status'] = 'simulated'
    else:
        done('solve')
        report = pyomo_fesd.report(m)
        row |= {
            'equations': report['constraints'],
            'pairs': report['pairs'],
            'status': str(results.solver.termination_condition),
        }
    if not smooth:
        found = idaes_level.changes_in(frame) if without_grid else idaes_level.changes(m)
        if [c.now for c in found] == [c.now for c in exact]:
            row['largest error of a time (s)'] = max(abs(a.time - b.time) for a, b in zip(found, exact))
        else:
            row['status'] += ', wrong switches'
    return row


def draw(table):
    """Seconds of each phase over the number of elements."""
    figure = Figure(figsize=(7, 4), layout='constrained')
    axis, smooth = figure.subplots(), table[table['variant'] == 'smooth, fixed grid, element by element']
    without_grid, table = (table[table['variant'] == variant] for variant in ('simulate, no grid', 'all calls'))
    for phase in PHASES:
        axis.loglog(table['elements'], table[f'{phase} (s)'], 'o-', label='simulate' if phase == 'march' else phase)
    seconds = smooth[['march (s)', 'solve (s)']].sum(axis=1)
    everything = without_grid[['build (s)', 'initialise (s)', 'march (s)']].sum(axis=1)
    axis.loglog(without_grid['elements'], everything, 's:', color='C3', label='simulate without\na grid, everything')
    axis.loglog(smooth['elements'], seconds, 'k--', label='smooth, fixed grid:\nelement by element,\nand solve')
    stopped = smooth['solve (s)'].isna()
    axis.loglog(smooth['elements'][stopped], seconds[stopped], 'k^', label='stopped before its end')
    axis.set_xticks(table['elements'], table['elements'], minor=False)
    axis.set_xticks([], minor=True)
    axis.set_xlabel('elements')
    axis.set_ylabel('CPU time (s)')
    figure.legend(loc='outside right upper')
    return figure


def main():
    """Measure the missing rows and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', type=int, help="one number of elements")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--measure', nargs=2, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.measure:
        print(json.dumps(measure(int(chosen.measure[0]), chosen.measure[1])))
        return
    rows = Rows(HERE / 'rows.csv', ('elements', 'variant'), COLUMNS, fresh=chosen.fresh)
    for nfe in reversed(SIZES) if chosen.only is None else (chosen.only,):
        for variant in (v for v, sizes in VARIANTS.items() if nfe in sizes and (nfe, v) not in rows):
            found, status = json_lines(__file__, '--measure', nfe, variant, limit=LIMIT)
            row = found[-1] if found else {'elements': nfe, 'variant': variant, 'status': status}
            print(row, flush=True)
            rows.add(row)
    draw(pd.read_csv(rows.path).sort_values('elements')).savefig(HERE / 'summary.png', dpi=150)


if __name__ == '__main__':
    main()
