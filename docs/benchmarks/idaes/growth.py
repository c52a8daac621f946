"""Why the fixed bed 1D has no reference: modes that grow, and no short first step.

    python docs/benchmarks/idaes/growth.py

Writes growth.csv, the eigenvalues with a positive real part of the published equations, made linear at the published start and at
the published solution; and first_step.csv, one step of the implicit Euler method of several lengths from the published start.
Both use the equations of the folder ``reference`` and nothing of the package.  Needs the extra [idaes].
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
import pandas as pd
import pyomo.environ as pyo
from benchmarks.idaes.cases import CASES
from benchmarks.idaes.reference import Equations
from benchmarks.idaes.run import built

HERE, NAME, ELEMENTS = Path(__file__).parent, 'fixed bed 1D', 3
#: Real parts (1/s) that are more than round-off.
GROWS = 1e-6
LENGTHS = (120, 30, 10, 3, 1)
NEWTON_STEPS, CONVERGED = 30, 1e-9
OUTLET = 'fs.unit.gas_phase.properties[{label},1.0].{quantity}'


def values_at(equations, values, label, time):
    """Values w of the equations of ``label`` with those that the variables have at another time."""
    names = (name.replace(f'[{label}', f'[{time}') for name in equations.names)
    return np.array([1.0 if values.get(name) is None else values[name] for name in names])


def growth(equations, w):
    """Real parts of the eigenvalues of dx/dt as a function of x that are positive, by size."""
    J = equations.jacobian(w, ()).toarray()
    taken = {*equations.rates, *equations.states}
    algebraic = [k for k in range(len(equations.names)) if k not in taken]
    M = J[:, [*equations.rates, *algebraic]]
    row = 1 / np.abs(M).max(axis=1)
    column = 1 / (np.abs(M) * row[:, None]).max(axis=0)
    change = np.linalg.solve(M * row[:, None] * column, -J[:, equations.states] * row[:, None]) * column[:, None]
    real = np.linalg.eigvals(change[: len(equations.states)]).real
    return np.sort(real[real > GROWS])


def euler(equations, w, length):
    """One step of the implicit Euler method by Newton's method from ``w``; None where it does not converge."""
    states, rates, count = equations.states, equations.rates, len(equations.states)
    tied = np.zeros((count, w.size))
    tied[np.arange(count), states], tied[np.arange(count), rates] = 1.0, -length
    first = w[states].copy()
    for _ in range(NEWTON_STEPS):
        residual = np.concatenate([equations.residual(w, ()), w[states] - first - length * w[rates]])
        M = np.vstack([equations.jacobian(w, ()).toarray(), tied])
        row = 1 / np.abs(M).max(axis=1)
        column = 1 / (np.abs(M) * row[:, None]).max(axis=0)
        change = np.linalg.solve(M * row[:, None] * column, residual * row) * column
        if not np.isfinite(change).all():
            return None
        w = w - change
        if (np.abs(change[states]) <= CONVERGED * np.maximum(np.abs(w[states]), 1e-6)).all():
            return w
    return None


def main():
    """Write both tables."""
    m = built(CASES[NAME], ELEMENTS)
    time, values = m.fs.time, {v.name: v.value for v in m.component_data_objects(pyo.Var)}
    rows = []
    for label in list(time)[1:]:
        equations = Equations(m, time, label)
        starts = {label: equations.guess}
        if label == time.last():
            starts[time.first()] = values_at(equations, values, label, time.first())
        for at, w in starts.items():
            found = growth(equations, w)
            rows.append({'time (s)': at, 'growing modes': found.size, 'slowest (1/s)': found.min(), 'fastest (1/s)': found.max()})
    pd.DataFrame(rows).sort_values('time (s)').to_csv(HERE / 'growth.csv', index=False, float_format='%.4g')
    label, steps = time.last(), []
    for length in LENGTHS:
        w = euler(equations, values_at(equations, values, label, time.first()), length)
        at_outlet = dict(zip(equations.names, [None] * len(equations.names) if w is None else w))
        flow, pressure = (at_outlet[OUTLET.format(label=label, quantity=q)] for q in ('flow_mol', 'pressure'))
        status = 'no solution found' if w is None else 'solved'
        steps.append({'length (s)': length, 'outlet flow (mol/s)': flow, 'outlet pressure (Pa)': pressure, 'status': status})
    pd.DataFrame(steps).to_csv(HERE / 'first_step.csv', index=False, float_format='%.5g')


if __name__ == '__main__':
    main()
