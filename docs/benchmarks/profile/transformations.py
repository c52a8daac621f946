"""CPU time of the transformations beside that of plain collocation, which is not avoidable.

    .venv/bin/python docs/benchmarks/profile/transformations.py

The gas-liquid tank on N elements of three Radau points: ``fesd.dcs`` and ``fesd.finite_elements``; and ``dae.collocation`` of the
same balances with a valve that lets only liquid through, so without a switch.  Both in turns, as the machine may have other work.
Writes transformations.csv beside this file: medians over the runs, and their ratio.
"""

import gc
import os
import statistics
import sys
import time
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')
sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import gas_liquid_tank as tank
import pandas as pd
import pyomo.environ as pyo

import pyomo_fesd  # noqa: F401  registers the transformations

HERE = Path(__file__).parent
POINTS = 3
#: Elements -> runs.
SIZES = {25: 15, 100: 15, 400: 7, 1600: 3}


def plain():
    """The tank without a switch: the valve lets only liquid through."""
    m = tank.balances()
    m.liquid = pyo.Constraint(m.t, rule=lambda m, t: m.L[t] == tank.through_valve(m, t))
    m.gas = pyo.Constraint(m.t, rule=lambda m, t: m.G[t] == 0)
    return m


def collocate(m, N):
    """Discretise a plain model."""
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=N, ncp=POINTS, scheme='LAGRANGE-RADAU')


def transform(m, N):
    """Discretise a model with a switch."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=N, ncp=POINTS)


def seconds(build, discretise, N):
    """CPU seconds of one discretisation."""
    m = build()
    gc.collect()
    begin = time.process_time()
    discretise(m, N)
    return time.process_time() - begin


def measure(N, runs):
    """The row of N elements."""
    pairs = [(seconds(plain, collocate, N), seconds(tank.build, transform, N)) for _ in range(runs)]
    of_plain, ours = map(statistics.median, zip(*pairs))
    return {'elements': N, 'runs': runs, 'dae.collocation': of_plain, 'fesd': ours, 'fesd / dae.collocation': ours / of_plain}


def main():
    """Measure everything, write the table."""
    measure(*next(iter(SIZES.items())))  # what is imported and kept at the first call
    table = pd.DataFrame([measure(*size) for size in SIZES.items()])
    table.to_csv(HERE / 'transformations.csv', index=False, float_format='%.3g', lineterminator='\n')
    print(table.to_string(index=False))


if __name__ == '__main__':
    main()
