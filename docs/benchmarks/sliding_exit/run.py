"""A sliding mode that ends smoothly: exit time and end state, beside nosnoc 0.2.0 in the same run.

    .venv/bin/pip install nosnoc==0.2.0
    .venv/bin/python docs/benchmarks/sliding_exit/run.py

    dx/dt = exp(s) - 1 - sgn x,   ds/dt = 1,   from (0, 0) to s = 2

The state slides on x = 0 until exp(s) = 2, then x = exp(s) - 2 s - 2 + 2 log 2.  All elements in one problem; nosnoc at
comp_tol=1e-12.  Writes rows.csv and summary.png beside this file.
"""

import sys
from math import exp, log
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import casadi as ca
import numpy as np
import pandas as pd
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.common.nosnoc_peer import options
from matplotlib.figure import Figure
from nosnoc import NosnocModel, NosnocSolver
from pyomo.gdp import Disjunction

import pyomo_fesd

HERE = Path(__file__).parent
END, EXIT = 2.0, log(2)
X_END = exp(END) - 2 * END - 2 + 2 * EXIT
NUMBERS, POINTS = (5, 10, 20, 40, 80), (2, 3)
TOOLS = ('pyomo_fesd', 'nosnoc 0.2.0')


def with_pyomo_fesd(N, K):
    """Exit time, end state and verdict."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, END))
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    s = pyomo_fesd.clock(m)
    m.push = pyo.Expression(m.t, rule=lambda m, t: pyo.exp(s[t]) - 1)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == m.push[t] + 1], [m.x[t] >= 0, m.dx[t] == m.push[t] - 1]])
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=N, ncp=K)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    return pyomo_fesd.switches(m)[-1].time, m.x[END].value, str(results.solver.stationarity)


def with_nosnoc(N, K):
    """The same with nosnoc; theta of the mode x > 0 is 1 after the exit."""
    x, s = ca.SX.sym('x'), ca.SX.sym('s')
    push = ca.exp(s) - 1
    model = NosnocModel(
        x=ca.vertcat(x, s),
        x0=np.zeros(2),
        F=[ca.horzcat(ca.vertcat(push - 1, 1), ca.vertcat(push + 1, 1))],
        c=[x],
        S=[np.array([[1], [-1]])],
    )
    solver = NosnocSolver(options('RADAU', 1e-12, terminal_time=END, N_finite_elements=N, n_s=K, print_level=0), model)
    results = solver.solve()
    w, problem = results['w_sol'], solver.problem
    (elements,) = problem.ind_theta
    slides = [any(1e-6 < w[point[0][0]] < 1 - 1e-6 for point in element) for element in elements]
    last = max((n for n, slide in enumerate(slides) if slide), default=-1)
    return w[problem.ind_h][: last + 1].sum(), results['x_out'][0], results['status'].name


def measure():
    """One row for each run."""
    rows = []
    for K in POINTS:
        for N in NUMBERS:
            for tool, run in zip(TOOLS, (with_pyomo_fesd, with_nosnoc)):
                time, x, verdict = run(N, K)
                rows.append(
                    {'tool': tool, 'K': K, 'N': N, 'verdict': verdict}
                    | {'error of the time': abs(time - EXIT), 'error of the end state': abs(x - X_END)}
                )
    return pd.DataFrame(rows)


def draw(table):
    """Errors against the number of elements."""
    figure = Figure(figsize=(8, 3.6), layout='constrained')
    for axis, column in zip(figure.subplots(1, 2), ('error of the time', 'error of the end state')):
        for (tool, K), group in table.groupby(['tool', 'K']):
            style = 'o-' if tool == TOOLS[0] else 's--'
            axis.loglog(group['N'], group[column], style, color=f'C{K}', label=f'{tool}, Radau {K}')
        axis.set_xticks(NUMBERS, [str(N) for N in NUMBERS])
        axis.minorticks_off()
        axis.set_xlabel('number of elements N')
        axis.set_title(column, fontsize='medium')
        axis.grid(alpha=0.3)
    axis.legend(fontsize='small')
    return figure


def main():
    """Measure, write the table and the picture."""
    table = measure()
    table.to_csv(HERE / 'rows.csv', index=False, float_format='%.3g')
    draw(table).savefig(HERE / 'summary.png', dpi=150)
    print(table.to_string(index=False))


if __name__ == '__main__':
    main()
