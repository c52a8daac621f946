"""Derivatives by ``sensitivity`` against closed forms and against differences of certified solutions.

    .venv/bin/python docs/benchmarks/sensitivities/run.py

Writes rows.csv (every derivative) and summary.csv beside this file.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
import pandas as pd
import pyomo.environ as pyo
from benchmarks.sensitivities.cases import CASES

import pyomo_fesd

HERE = Path(__file__).parent
#: Step of the differences, and the tolerance of the solutions.
EPS, TOLERANCE = 1e-4, 1e-12


def values(outputs):
    """Numbers of outputs; the time of a switch."""
    return np.array([output.time if hasattr(output, 'time') else pyo.value(output) for output in outputs])


def by_differences(case):
    """Central differences of fourth order of solutions, each from the one before."""
    m, solver = case.model, pyo.SolverFactory('mpec_hybrid')
    solver.set_instance(m, case.parameters)
    data = [p for component in case.parameters for p in (component.values() if component.is_indexed() else [component])]

    def at(p, number):
        p.set_value(number)
        results = solver.solve(m, warm_start=True, branch_tol=TOLERANCE)
        assert results.solver.termination_condition == 'optimal'
        return values(case.outputs())

    columns = []
    for p in data:
        now = pyo.value(p)
        near, far = (at(p, now + step) - at(p, now - step) for step in (EPS, 2 * EPS))
        columns.append((8 * near - far) / (12 * EPS))
        at(p, now)
    return np.column_stack(columns)


def measure():
    """Yield the rows of each case: every derivative, and the CPU seconds of both ways."""
    for build in CASES:
        case = build()
        begun = time.process_time()
        found = pyomo_fesd.sensitivity(case.model, case.parameters, case.outputs())
        between = time.process_time()
        differences = by_differences(case)
        ended = time.process_time()
        exact = np.full(found.shape, np.nan) if case.exact is None else case.exact
        for (i, output), (j, parameter) in ((x, y) for x in enumerate(found.index) for y in enumerate(found.columns)):
            yield {
                'case': case.name,
                'output': output,
                'parameter': parameter,
                'sensitivity': found.iloc[i, j],
                'differences': differences[i, j],
                'closed form': exact[i, j],
                'seconds': between - begun,
                'seconds of differences': ended - between,
            }
        print(case.name, flush=True)


def summary(rows):
    """Per case the number of derivatives, the largest one, and the largest distances."""
    found = []
    for name, group in rows.groupby('case', sort=False):
        by = group['sensitivity']
        found.append(
            {'case': name, 'derivatives': len(group), 'largest': by.abs().max()}
            | {'from differences': (by - group['differences']).abs().max()}
            | {'from the closed form': (by - group['closed form']).abs().max()}
            | {'seconds': group['seconds'].iloc[0], 'of differences': group['seconds of differences'].iloc[0]}
        )
    return pd.DataFrame(found)


def main():
    """Measure, write the tables."""
    rows = pd.DataFrame(measure())
    rows.to_csv(HERE / 'rows.csv', index=False, float_format='%.12g')
    found = summary(rows)
    found.to_csv(HERE / 'summary.csv', index=False, float_format='%.2g')
    print(found.to_string())


if __name__ == '__main__':
    main()
