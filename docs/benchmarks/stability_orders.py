"""Stiff modes: the order of Radau and Gauss on Prothero and Robinson's problem, in one mode of a switching system.

python docs/benchmarks/stability_orders.py

writes stability_orders.csv beside this file.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

from stability_cases import GAUSS, RADAU, Case  # noqa: E402
from stability_problems import stiff  # noqa: E402

STIFFNESS, NUMBERS, LIMIT = (1e0, 1e3, 1e6), (5, 10, 20), 60


def main():
    """Errors of the end state for each scheme, stiffness and number of elements."""
    rows = []
    for scheme in (RADAU, GAUSS):
        for ncp in (2, 3):
            for stiffness in STIFFNESS:
                errors = []
                for nfe in NUMBERS:
                    case = Case('stiff mode', '', 0, stiff(stiffness), nfe, ncp, scheme)
                    outcome = case.run('mpec_hybrid', LIMIT)
                    errors.append(case.error(outcome.values) if outcome.solved else np.nan)
                order = np.log2(errors[-2] / errors[-1])
                name = f"{scheme.split('-')[1].capitalize()} {ncp}"
                rows.append(
                    {'scheme': name, 'stiffness': f'{stiffness:.0e}'}
                    | {f'error, {n} elements': f'{e:.1e}' for n, e in zip(NUMBERS, errors)}
                    | {'order seen': round(order, 1), 'order of the scheme': 2 * ncp - (scheme == RADAU)}
                )
                print(rows[-1], flush=True)
    pd.DataFrame(rows).to_csv(HERE / 'stability_orders.csv', index=False)


if __name__ == '__main__':
    main()
