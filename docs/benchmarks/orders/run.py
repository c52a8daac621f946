"""Observed orders of accuracy on the oscillator: slopes of log(error) against log(N), beside the order of the scheme.

    python docs/benchmarks/orders/run.py

Writes rows.csv and summary.png beside this file.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import oscillator
import pandas as pd
from benchmarks.common.fits import exponent
from matplotlib.figure import Figure

HERE = Path(__file__).parent
#: scheme, K, numbers of elements (the coarsest grids that show the order, the finest above round-off), order of the scheme
CASES = (
    ('LAGRANGE-RADAU', 1, (800, 1600, 3200), 1),
    ('LAGRANGE-RADAU', 2, (40, 80, 160, 320), 3),
    ('LAGRANGE-RADAU', 3, (20, 40, 80, 160), 5),
    ('LAGRANGE-LEGENDRE', 1, (80, 160, 320, 640), 2),
    ('LAGRANGE-LEGENDRE', 2, (20, 40, 80, 160), 4),
    ('LAGRANGE-LEGENDRE', 3, (20, 40, 80, 160), 6),
)


def run(scheme, K, N):
    """Solve once; return error and work."""
    started = time.perf_counter()
    m, results = oscillator.solve(N, K, scheme)
    return {
        'error': oscillator.error(m),
        'certified': str(results.solver.stationarity) == 'B',
        'nlps': int(results.solver.nlps),
        'iterations': int(results.solver.nlp_iterations),
        'seconds': time.perf_counter() - started,
    }


def measure():
    """One row for each run."""
    rows = []
    for scheme, K, numbers, order in CASES:
        for N in numbers:
            rows.append({'scheme': scheme, 'K': K, 'N': N, 'order': order} | run(scheme, K, N))
            print(pd.Series(rows[-1]).to_frame().T.to_string(header=len(rows) == 1, index=False), flush=True)
    return pd.DataFrame(rows)


def slope(group):
    """Observed order of one scheme."""
    return -exponent(group['N'], group['error'])


def draw(table):
    """Errors against the number of elements, with the observed orders in the legend."""
    figure = Figure(figsize=(6, 4.5), layout='constrained')
    axis = figure.subplots()
    for (scheme, K, order), group in table.groupby(['scheme', 'K', 'order']):
        style = 'o-' if scheme.endswith('RADAU') else 's--'
        name = scheme.removeprefix('LAGRANGE-').capitalize()
        axis.loglog(group['N'], group['error'], style, label=f'{name} {K}: slope {slope(group):.2f} (order {order})')
    axis.set_xlabel('number of elements N')
    axis.set_ylabel('error of the end state')
    axis.legend(fontsize='small')
    axis.grid(alpha=0.3)
    return figure


def main():
    """Measure, write the table and the picture."""
    table = measure()
    table.to_csv(HERE / 'rows.csv', index=False, float_format='%.6g')
    draw(table).savefig(HERE / 'summary.png', dpi=150)
    print(table.groupby(['scheme', 'K', 'order']).apply(slope, include_groups=False).rename('slope').to_string())


if __name__ == '__main__':
    main()
