"""The car with the gearbox (examples/gearbox_car.py): which settings end in which of its many local minima.

    python docs/benchmarks/gearbox.py

writes gearbox.csv beside this file.
"""

import sys
import time
from itertools import product
from pathlib import Path

import pandas as pd

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parents[1] / 'examples')]

import gearbox_car  # noqa: E402

import pyomo_fesd  # noqa: E402

#: name -> ends of the control stages, and elements in each
STAGES = {'fitting': (gearbox_car.FITTING, 4)} | {f'{n} equal': (tuple(k / n for k in range(n + 1)), 3) for n in (5, 10, 15, 20)}
RELAXATIONS = ('elastic', 'scholtes')
STARTS = (1, 4)
LIMIT = 60  # s for each run


def measure(name, relaxation, starts):
    """One row: how late the car arrives, and what it took."""
    started = time.perf_counter()
    m, results = gearbox_car.solve(*STAGES[name], relaxation=relaxation, starts=starts, time_limit=LIMIT)
    switches = [f'{s.time:.2f}' for s in pyomo_fesd.switches(m)]
    return {
        'stages': name,
        'relaxation': relaxation,
        'starts': starts,
        'T (s)': round(m.T.value, 5),
        'above T* (%)': round(100 * (m.T.value / gearbox_car.BEST - 1), 2),
        'certified': str(results.solver.stationarity) == 'B',
        'gear changes (s)': ' '.join(switches),
        'nlps': int(results.solver.nlps),
        'iterations': int(results.solver.nlp_iterations),
        'seconds': round(time.perf_counter() - started, 1),
    }


def main():
    """Measure all, write the table."""
    rows = []
    for case in product(STAGES, RELAXATIONS, STARTS):
        rows.append(measure(*case))
        print(pd.Series(rows[-1]).to_frame().T.to_string(header=len(rows) == 1, index=False), flush=True)
    pd.DataFrame(rows).to_csv(HERE / 'gearbox.csv', index=False)


if __name__ == '__main__':
    main()
