"""Stiff modes: the observed order of Radau and Gauss on Prothero and Robinson's problem, in one mode of a switching system.

    .venv/bin/python docs/benchmarks/stability/orders.py

Writes orders.csv beside this file.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
import pandas as pd
from benchmarks.stability.cases import GAUSS, RADAU, Case
from benchmarks.stability.families.smooth_dynamics import stiff

HERE = Path(__file__).parent
STIFFNESS, NUMBERS, LIMIT = (1e0, 1e3, 1e6), (5, 10, 20), 60


def measure(scheme, ncp, stiffness):
    """Errors of the end state and the observed order, as one row."""
    errors = []
    for nfe in NUMBERS:
        case = Case('stiff mode', '', 0, stiff(stiffness), nfe, ncp, scheme)
        outcome = case.run('mpec_hybrid', LIMIT)
        errors.append(case.error(outcome.values) if outcome.solved else np.nan)
    order = np.log2(errors[-2] / errors[-1])
    return (
        {'scheme': f"{scheme.split('-')[1].capitalize()} {ncp}", 'stiffness': f'{stiffness:.0e}'}
        | {f'error, {n} elements': f'{e:.1e}' for n, e in zip(NUMBERS, errors)}
        | {'order seen': round(order, 1), 'order of the scheme': 2 * ncp - (scheme == RADAU)}
    )


def main():
    """Measure each scheme and stiffness, and write the table."""
    rows = []
    for scheme in (RADAU, GAUSS):
        for ncp in (2, 3):
            for stiffness in STIFFNESS:
                rows.append(measure(scheme, ncp, stiffness))
                print(rows[-1], flush=True)
    pd.DataFrame(rows).to_csv(HERE / 'orders.csv', index=False)


if __name__ == '__main__':
    main()
