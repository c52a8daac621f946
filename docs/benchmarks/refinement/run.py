"""Accuracy control: the result of ``pyomo_fesd.refine`` for a tolerance, beside the true error and the best uniform grid.

    python docs/benchmarks/refinement/run.py [--only NAME] [--fresh]

Writes rows.csv and summary.png beside this file; runs that have a row are skipped.  ``best N`` is the smallest number of equal
elements (within 5 %) whose true error is below the tolerance, found by bisection.
"""

import argparse
import sys
import time
from bisect import bisect_left
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import numpy as np
import pandas as pd
import pyomo.environ as pyo
from benchmarks.common.rows import Rows
from benchmarks.refinement.problems import PROBLEMS
from matplotlib.figure import Figure

import pyomo_fesd

HERE = Path(__file__).parent
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
#: Candidates for the best number of elements.
CANDIDATES = sorted({round(8 * 1.05**k) for k in range(110)})
KEY = ('problem', 'tolerance')
COLUMNS = (*KEY, 'reached', 'estimate', 'true error', 'rounds', 'N', 'N of all rounds', 'best N', 'seconds')


def refined(problem, tolerance, **options):
    """Refine to a tolerance; return the result of ``refine`` and the true error."""
    m = problem.model()
    found = pyomo_fesd.refine(m, tolerance, **options)
    return found, problem.error(m)


def uniform(problem, number, tolerance):
    """The true error on ``number`` equal elements, solved as ``refine`` does; infinite without a solution."""
    m = problem.model()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=number, ncp=3)
    try:
        if m.component('cost') is None:
            pyomo_fesd.simulate(m, branch_tol=max(1e-12, 1e-3 * tolerance))
        else:
            pyo.SolverFactory('mpec_hybrid').solve(m, branch_tol=max(1e-12, 1e-3 * tolerance))
    except pyomo_fesd.FesdError:
        return np.inf
    return problem.error(m)


def best_number(problem, tolerance, enough):
    """The smallest sufficient number of equal elements, to 5 %, given a sufficient one."""
    numbers = [n for n in CANDIDATES if n <= enough]
    position = bisect_left(numbers, True, key=lambda n: uniform(problem, n, tolerance) <= tolerance)
    return numbers[position] if position < len(numbers) else enough


def measure(name, tolerance):
    """One row."""
    problem, started = PROBLEMS[name], time.perf_counter()
    found, error = refined(problem, tolerance)
    seconds = time.perf_counter() - started
    table = found.table
    best = best_number(problem, tolerance, int(table['elements'].iloc[-1]))
    return {
        'problem': name,
        'tolerance': tolerance,
        'reached': found.reached,
        'estimate': found.error,
        'true error': error,
        'rounds': len(table),
        'N': table['elements'].iloc[-1],
        'N of all rounds': table['elements'].sum(),
        'best N': best,
        'seconds': seconds,
    }


def draw(table):
    """True errors and estimates against the tolerance; elements beside the best number."""
    figure = Figure(figsize=(10, 4.2), layout='constrained')
    errors, numbers = figure.subplots(1, 2)
    for k, (name, rows) in enumerate(table.groupby('problem', sort=False)):
        errors.loglog(rows['tolerance'], np.maximum(rows['true error'], 1e-14), 'o-', color=f'C{k}', label=name)
        errors.loglog(rows['tolerance'], np.maximum(rows['estimate'], 1e-14), 'x:', color=f'C{k}')
        numbers.loglog(rows['best N'], rows['N'], 'o-', color=f'C{k}', label=name)
    ends = [min(TOLERANCES), max(TOLERANCES)]
    errors.loglog(ends, ends, color='0.4', linewidth=0.8)
    errors.set_xlabel('tolerance asked for')
    errors.set_ylabel('true error (o), estimate (x)')
    errors.legend(fontsize='small')
    ends = np.array([table['best N'].min(), table['best N'].max()])
    for factor in (1, 2):
        numbers.loglog(ends, factor * ends, color='0.4', linewidth=0.8, linestyle='-' if factor == 1 else ':')
    numbers.set_xlabel('best number of equal elements')
    numbers.set_ylabel('elements of refine')
    return figure


def main():
    """Measure the missing rows and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', choices=PROBLEMS, help="one problem")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    chosen = parser.parse_args()
    rows = Rows(HERE / 'rows.csv', KEY, COLUMNS, digits=4, fresh=chosen.fresh)
    for name in [chosen.only] if chosen.only else PROBLEMS:
        for tolerance in TOLERANCES:
            if (name, tolerance) not in rows:
                row = measure(name, tolerance)
                print(*row.values(), flush=True)
                rows.add(row)
    draw(pd.read_csv(rows.path)).savefig(HERE / 'summary.png', dpi=150)


if __name__ == '__main__':
    main()
