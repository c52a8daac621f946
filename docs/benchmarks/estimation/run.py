"""Threshold, coefficients and an initial state of a tank from noisy levels of two experiments, from 20 random starts.

    .venv/bin/python docs/benchmarks/estimation/run.py

    dh/dt = u_k - a h                    below the side outlet, h <= c
    dh/dt = u_k - a h - b (h - c)        above it

Two experiments k with different inflows, each with 15 measurements at random times; a, b, c and the initial level of the first one
are unknown.  Each experiment has its own ContinuousSet.  Writes rows.csv, summary.csv and summary.png beside this file.
``monte_carlo.py`` repeats the estimation with other noise.
"""

import sys
import time
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
import pandas as pd
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.common.rows import Rows
from matplotlib.figure import Figure
from pyomo.gdp import Disjunction
from scipy.optimize import least_squares

import pyomo_fesd

HERE = Path(__file__).parent
TRUTH = {'a': 0.5, 'b': 2.0, 'c': 1.0, 'h_0': 0.2}
BOUNDS = {'a': (0.1, 2.0), 'b': (0.2, 6.0), 'c': (0.4, 1.8), 'h_0': (0.0, 0.8)}
INFLOWS, GIVEN_START = (1.2, 1.8), 0.0
HORIZON, NUMBER, NOISES, NFES, STARTS = 3.0, 15, (0.01, 0.0), (6, 12), 20
#: A run is at the best misfit, or at the least one of the closed form, if its own is larger by at most this part.  Without noise it
#: is at the noise floor if its misfit is at most that of the true values on the same grid.
BEST = 0.01
COLUMNS = ('noise', 'nfe', 'start', 'verdict', 'misfit', *TRUTH, 'NLPs', 'iterations', 'seconds')


def exact(u, h_0, times, a, b, c):
    """Levels and switching time in closed form; the level rises through c once."""
    t_s = np.log((h_0 - u / a) / (c - u / a)) / a
    steady = (u + b * c) / (a + b)
    above = steady + (c - steady) * np.exp(-(a + b) * (times - t_s))
    return np.where(times < t_s, u / a + (h_0 - u / a) * np.exp(-a * times), above), t_s


def measurements(noise):
    """Times and levels of each experiment."""
    random = np.random.default_rng(0)
    values = {name: TRUTH[name] for name in 'abc'}
    for u, h_0 in zip(INFLOWS, (TRUTH['h_0'], GIVEN_START)):
        times = np.sort(random.uniform(0.05, HORIZON, NUMBER))
        yield times, exact(u, h_0, times, **values)[0] + noise * random.normal(size=NUMBER)


def least_of_closed_form(data):
    """Misfit and estimates of least squares on the closed form, from the truth."""

    def residuals(theta):
        a, b, c, h_0 = theta
        levels = [exact(u, h, times, a, b, c)[0] for u, h, (times, _) in zip(INFLOWS, (h_0, GIVEN_START), data)]
        return np.concatenate([found - measured for found, (_, measured) in zip(levels, data)])

    found = least_squares(residuals, list(TRUTH.values()), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return 2 * found.cost, dict(zip(TRUTH, found.x))


def build(data, start, nfe):
    """Both experiments with the sum of squared residuals; ``start`` has the first values of the unknowns.

    The measured levels are the mutable Param ``level``.
    """
    m = pyo.ConcreteModel()
    for name, bounds in BOUNDS.items():
        m.add_component(name, pyo.Var(initialize=start[name], bounds=bounds))

    @m.Block(range(len(INFLOWS)))
    def run(d, k):
        d.t = dae.ContinuousSet(bounds=(0, HORIZON))
        d.h = pyo.Var(d.t, initialize=0.5)
        d.dh = dae.DerivativeVar(d.h)
        d.begin = pyo.Constraint(expr=d.h[0] == (m.h_0 if k == 0 else GIVEN_START))
        through = lambda d, t: INFLOWS[k] - m.a * d.h[t]  # noqa: E731
        d.outlet = Disjunction(
            d.t,
            rule=lambda d, t: [
                [d.h[t] <= m.c, d.dh[t] == through(d, t)],
                [d.h[t] >= m.c, d.dh[t] == through(d, t) - m.b * (d.h[t] - m.c)],
            ],
        )

    for d in m.run.values():
        pyo.TransformationFactory('fesd.dcs').apply_to(d)
        pyo.TransformationFactory('fesd.finite_elements').apply_to(d, wrt=d.t, nfe=nfe, ncp=3)
    measured = {(k, n): h for k, (_, levels) in enumerate(data) for n, h in enumerate(levels)}
    m.level = pyo.Param(list(measured), initialize=measured, mutable=True)
    at_times = {(k, n): pyomo_fesd.at(m.run[k].h, t) for k, (times, _) in enumerate(data) for n, t in enumerate(times.tolist())}
    m.misfit = pyo.Objective(expr=sum((at_times[i] - m.level[i]) ** 2 for i in at_times))
    return m


def measure(rows):
    """Estimate from each start; a start that has its row is not repeated."""
    for noise, nfe in product(NOISES, NFES):
        data, random = list(measurements(noise)), np.random.default_rng(7)
        for number in range(STARTS):
            start = {name: random.uniform(*bounds) for name, bounds in BOUNDS.items()}
            if (noise, nfe, number) in rows:
                continue
            m, begun = build(data, start, nfe), time.process_time()
            solver = pyo.SolverFactory('mpec_hybrid').solve(m, load_solutions=True).solver
            rows.add(
                {'noise': noise, 'nfe': nfe, 'start': number, 'verdict': solver.stationarity, 'misfit': pyo.value(m.misfit)}
                | {name: m.component(name).value for name in TRUTH}
                | {'NLPs': solver.nlps, 'iterations': solver.nlp_iterations, 'seconds': time.process_time() - begun}
            )


def summary(table):
    """Per noise and grid: certified runs, runs at the best misfit, and the largest errors of all runs, beside their references."""
    found = []
    for (noise, nfe), group in table.groupby(['noise', 'nfe'], sort=False):
        least, estimates = least_of_closed_form(list(measurements(noise)))
        best = group['misfit'].min()
        at_best = group['misfit'] <= best * (1 + BEST)
        row = {'noise': noise, 'elements': nfe, 'starts': len(group), 'certified': (group['verdict'] == 'B').sum()}
        of_truth = misfit_of_truth(noise, nfe)
        floor = least * (1 + BEST) if noise else of_truth
        row |= {'at the noise floor': (group['misfit'] <= floor).sum(), 'within 1 % of the best misfit': at_best.sum()}
        row |= {'best misfit': best, 'worst misfit': group['misfit'].max()}
        row |= {'least misfit of the closed form': least, 'misfit of the truth on this grid': of_truth}
        row |= {'NLPs (median)': group['NLPs'].median(), 'seconds (median)': group['seconds'].median()}
        for name in TRUTH:
            row[f'{name}: largest error'] = (group[name] - TRUTH[name]).abs().max()
            row[f'{name}: error of the closed form'] = abs(estimates[name] - TRUTH[name])
            row[f'{name}: largest distance from the closed form'] = (group[name] - estimates[name]).abs().max()
        found.append(row | {f'{name}: standard deviation': d for name, d in deviations(noise, nfe).items()})
    return pd.DataFrame(found, dtype=object)


def misfit_of_truth(noise, nfe):
    """The sum of squares of a simulation with the true values: without noise, the error of the grid."""
    m = build(list(measurements(noise)), TRUTH, nfe)
    for name in TRUTH:
        m.component(name).fix()
    m.misfit.deactivate()
    pyo.SolverFactory('mpec_hybrid').solve(m)
    return pyo.value(m.misfit)


def deviations(noise, nfe):
    """Standard deviations of the estimates by ``covariance``, at the solution from the truth."""
    if noise == 0:
        return dict.fromkeys(TRUTH, 0.0)
    m = build(list(measurements(noise)), TRUTH, nfe)
    pyo.SolverFactory('mpec_hybrid').solve(m)
    found = pyomo_fesd.covariance(m, [m.component(name) for name in TRUTH], noise**2)
    return {name: float(np.sqrt(found.loc[name, name])) for name in TRUTH}


def draw():
    """Measurements and fitted levels of both experiments."""
    figure = Figure(figsize=(7, 3.6), layout='constrained')
    axis, data = figure.subplots(), list(measurements(NOISES[0]))
    m = build(data, TRUTH, NFES[0])
    pyo.SolverFactory('mpec_hybrid').solve(m)
    for k, (times, levels) in enumerate(data):
        frame = pyomo_fesd.trajectory(m.run[k], m.run[k].t)
        axis.plot(frame.filter(regex=r'(^|\.)h$'), color=f'C{k}', label=f'experiment {k + 1}')
        axis.plot(times, levels, 'o', color=f'C{k}', markersize=4)
    axis.axhline(m.c.value, color='0.4', linestyle='--', linewidth=0.8)
    axis.set_xlabel('time')
    axis.set_ylabel('level h; dashed: estimate of the outlet c')
    axis.legend()
    return figure


def main():
    """Measure, write the tables and the picture."""
    rows = Rows(HERE / 'rows.csv', ('noise', 'nfe', 'start'), COLUMNS)
    measure(rows)
    table = summary(pd.read_csv(HERE / 'rows.csv'))
    table.map(lambda cell: f'{cell:.3g}' if isinstance(cell, float) else cell).T.to_csv(HERE / 'summary.csv', header=False)
    draw().savefig(HERE / 'summary.png', dpi=150)
    print(table.T.to_string())


if __name__ == '__main__':
    main()
