"""chemakzo by ``refine``, which places fixed points, beside equal elements: elements, CPU seconds, errors against the reference.

    python docs/benchmarks/idaes/refinement.py [--fresh]

The published script without its discretisation.  Writes refinement.csv.  Needs the extra [idaes].
"""

import argparse
import sys
from pathlib import Path
from time import process_time
from unittest.mock import patch

sys.path.insert(0, str(Path(__file__).parents[2]))

import pyomo.environ as pyo
from benchmarks.common.rows import Rows
from benchmarks.idaes.cases import CASES
from benchmarks.idaes.run import built, end_error, reference, values_at_first
from pyomo.dae.plugins.finitedifference import Finite_Difference_Transformation

import pyomo_fesd

HERE = Path(__file__).parent
CASE = CASES['chemakzo']
TOLERANCES, NUMBERS = (1e-4, 1e-6, 1e-8), (80, 320, 1280)
SHORT = ('estimate', 'switch error', 'end state', 'CPU (s)')
COLUMNS = ('grid', 'elements', 'rounds', 'fixed points', 'estimate', 'switch', 'switch error', 'end state', 'CPU (s)')


def model():
    """The model before it is discretised, with its switch."""
    with patch.object(Finite_Difference_Transformation, 'apply_to', lambda *args, **options: None):
        m = built(CASE, 1)
    CASE.switch(m)
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    return m


def refined(m, tolerance):
    """What ``refine`` reports for the row."""
    found = pyomo_fesd.refine(m, tolerance)
    points = ' '.join(f'{t:g}' for t in found.fixed_points)
    return {
        'elements': found.table['elements'].iloc[-1],
        'rounds': len(found.table),
        'fixed points': points,
        'estimate': found.error,
    }


def equal(m, number):
    """The same for equal elements."""
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=number)
    pyomo_fesd.simulate(m)
    return {'elements': number}


def measure(grid, solve, how):
    """One row."""
    m = model()
    clock = process_time()
    row = {'grid': grid} | solve(m, how) | {'CPU (s)': process_time() - clock}
    exact = reference(CASE, built(CASE, 1), values_at_first(m))
    (switch,), (located, *_) = [s.time for s in pyomo_fesd.switches(m)], [s[0] for s in exact.switches]
    return row | {'switch': float(f'{switch:.9g}'), 'switch error': abs(switch - located), 'end state': end_error(m, exact)}


def main():
    """Measure the missing rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    rows = Rows(HERE / 'refinement.csv', ('grid',), COLUMNS, fresh=parser.parse_args().fresh, digits=9)
    runs = [(f'refine to {tolerance:g}', refined, tolerance) for tolerance in TOLERANCES]
    runs += [(f'{number} equal elements', equal, number) for number in NUMBERS]
    for grid, solve, how in runs:
        if (grid,) not in rows:
            row = measure(grid, solve, how)
            print(row, flush=True)
            rows.add(row | {name: float(f'{row[name]:.2g}') for name in SHORT if name in row})


if __name__ == '__main__':
    main()
