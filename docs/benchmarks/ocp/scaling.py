"""Ipopt's own scaling of rows and objective on the optimal control problems: iterations and CPU time with and without it.

    .venv/bin/python docs/benchmarks/ocp/scaling.py

Ipopt scales each row, and the objective, so that their largest gradient entries at the start of an NLP are at most 100.
``mpec_hybrid`` leaves rows up to 1e4 as they are where elements have lengths.

Changes: ``gradient``, Ipopt's own way; ``none``, no scaling.
Eleven starts of each problem, as in run.py.  Writes scaling.csv beside this file, one row for each problem and change: medians over
the starts.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import pandas as pd
import pyomo.environ as pyo
from benchmarks.ocp.run import STARTS, initialise, module, random_controls
from pyomo.common.timing import HierarchicalTimer

import pyomo_fesd  # noqa: F401  registers mpec_hybrid
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc

HERE = Path(__file__).parent
PROBLEMS = ('sliding', 'motor', 'cartpole', 'tank')
#: Ipopt's nlp_scaling_max_gradient.
LARGEST = 100.0
LIMIT = 60
#: The options of each change.
CHANGES = {'default': {}, 'gradient': {'nlp_scaling_method': 'gradient-based'}, 'none': {'nlp_scaling_method': 'none'}}


def gradients(m):
    """The largest entry of the objective's gradient at the model's initial values, and those of the rows."""
    c = compile_mpcc(read_mpcc(m), HierarchicalTimer())
    J = abs(c.stacked_jacobian(c.x0)[: len(c.lbg)])
    return abs(c.gradients(c.x0)[0]).max(), J.max(axis=1).toarray().ravel()


def started(problem, number):
    """The discretised model at start ``number``."""
    p = module(problem)
    m = p.build()
    ends = sorted(m.t)[1:]
    p.discretise(m)
    controls = random_controls(problem, number)
    if controls is not None:
        initialise(m, ends, controls)
    return m


def solve(problem, number, options):
    """One run."""
    m, begin = started(problem, number), time.process_time()
    results = pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=LIMIT, nlp_options=options)
    (objective,) = m.component_data_objects(pyo.Objective, active=True)
    return {
        'iterations': int(results.solver.nlp_iterations),
        'cpu': time.process_time() - begin,
        'certified': str(results.solver.stationarity) == 'B',
        'objective': pyo.value(objective),
    }


def measure(problem):
    """The rows of one problem."""
    of_objective, of_rows = gradients(started(problem, 0))
    steep = {'gradient of objective': of_objective, 'rows': len(of_rows), 'steep rows': int((of_rows > LARGEST).sum())}
    for change, options in CHANGES.items():
        runs = pd.DataFrame([solve(problem, number, options) for number in range(STARTS + 1)])
        yield {
            'problem': problem,
            'change': change,
            **steep,
            'iterations': runs['iterations'].median(),
            'most': runs['iterations'].max(),
            'cpu': runs['cpu'].median(),
            'certified': int(runs['certified'].sum()),
            'largest objective': runs['objective'].max(),
        }


def main():
    """Measure everything, write the table."""
    solve(PROBLEMS[0], 0, {})  # imports
    table = pd.DataFrame([row for problem in PROBLEMS for row in measure(problem)])
    table['cpu / default'] = table['cpu'] / table.groupby('problem')['cpu'].transform('first')
    table = table.drop(columns='cpu')
    table.to_csv(HERE / 'scaling.csv', index=False, float_format='%.5g')
    print(table.to_string())


if __name__ == '__main__':
    main()
