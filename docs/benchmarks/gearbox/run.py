"""The car with the gearbox (examples/gearbox_car.py): which settings end in which of its many local minima.

    python docs/benchmarks/gearbox/run.py

Writes rows.csv beside this file.
"""

import sys
import time
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import gearbox_car
import pandas as pd
import pyomo.environ as pyo

import pyomo_fesd

HERE = Path(__file__).parent
#: name -> boundaries of the control stages
STAGES = {'55, 52, 45': gearbox_car.BEST_STAGES} | {f'{n} equal': gearbox_car.equal_stages(n) for n in (5, 10, 15, 20)}
RELAXATIONS = ('elastic', 'scholtes')
#: Initial values: those of the model, or those of a simulation.
INITIAL_VALUES = ('as built', 'simulated')
STARTS = (1, 4)
LIMIT = 60  # s for each run


def measure(name, relaxation, initial_values, starts):
    """One row: arrival time of the car, and the work of the solver."""
    m = gearbox_car.transform(gearbox_car.build(STAGES[name]))
    if initial_values == 'simulated':
        gearbox_car.simulate_guess(m)
    started = time.perf_counter()
    results = pyo.SolverFactory('mpec_hybrid').solve(m, relaxation=relaxation, starts=starts, time_limit=LIMIT)
    switches = [f'{s.time / gearbox_car.HORIZON * m.T.value:.2f}' for s in pyomo_fesd.switches(m)]
    return {
        'stages': name,
        'relaxation': relaxation,
        'begin': initial_values,
        'starts': starts,
        'T (s)': round(m.T.value, 5),
        'above T* (%)': round(100 * (m.T.value / gearbox_car.T_BEST - 1), 2),
        'certified': str(results.solver.stationarity) == 'B',
        'gear changes (s)': ' '.join(switches),
        'nlps': int(results.solver.nlps),
        'iterations': int(results.solver.nlp_iterations),
        'seconds': round(time.perf_counter() - started, 1),
    }


def main():
    """Measure all rows and write the table."""
    rows = []
    for case in product(STAGES, RELAXATIONS, INITIAL_VALUES, STARTS):
        rows.append(measure(*case))
        print(pd.Series(rows[-1]).to_frame().T.to_string(header=len(rows) == 1, index=False), flush=True)
    pd.DataFrame(rows).to_csv(HERE / 'rows.csv', index=False)


if __name__ == '__main__':
    main()
