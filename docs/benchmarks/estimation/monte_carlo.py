"""Standard deviations by ``covariance`` against 200 estimates from other noise, each solved from the solution without noise.

    .venv/bin/python docs/benchmarks/estimation/monte_carlo.py

The experiments of ``run.py``, 12 elements, noise 0.01.  Writes monte_carlo.csv (a row for each sample, with the estimates, for
the first ones the deviations that ``covariance`` gives there, and the distance from least squares on the closed form),
monte_carlo_summary.csv, monte_carlo_overall.csv and monte_carlo.png beside this file.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
import pandas as pd
import pyomo.environ as pyo
from benchmarks.common.rows import Rows
from benchmarks.estimation.run import TRUTH, build, least_of_closed_form, measurements
from matplotlib.figure import Figure
from scipy import stats

import pyomo_fesd

HERE = Path(__file__).parent
NOISE, NFE, SAMPLES, SEED = 0.01, 12, 200, 1
#: Samples at whose own solution ``covariance`` is called as well.
OWN = 30
#: Switching times of the experiments, estimates as well.
TIMES = ('t_1', 't_2')
NAMES = (*TRUTH, *TIMES)
COLUMNS = ('sample', 'verdict', 'misfit', *NAMES, *(f'deviation of {name}' for name in NAMES))
COLUMNS = (*COLUMNS, 'distance from the closed form', 'seconds')
PLANE = ('b', 'c')


def samples():
    """Levels without noise, and for each sample the measured ones, by experiment."""
    data, random = list(measurements(0.0)), np.random.default_rng(SEED)
    for _ in range(SAMPLES):
        yield [(times, levels + NOISE * random.normal(size=levels.size)) for times, levels in data]


class Estimation:
    """The model, compiled once, at the solution without noise."""

    def __init__(self):
        self.model = m = build(list(measurements(0.0)), TRUTH, NFE)
        self._solver = pyo.SolverFactory('mpec_hybrid')
        self._solver.set_instance(m, [m.level])
        self._solver.solve(m)
        self._variables = list(m.component_data_objects(pyo.Var))
        self._begin = [v.value for v in self._variables]

    def solve(self, data):
        """Estimate from ``data``; returns the solver's results."""
        for v, number in zip(self._variables, self._begin):
            v.set_value(number, skip_validation=True)
        for k, (_, levels) in enumerate(data):
            for n, level in enumerate(levels):
                self.model.level[k, n] = float(level)
        return self._solver.solve(self.model, warm_start=True).solver

    def estimates(self):
        """Expressions of the estimates, and their values."""
        m = self.model
        switches = [pyomo_fesd.switches(d, d.t)[0] for d in m.run.values()]
        return dict(zip(NAMES, [*(m.component(name) for name in TRUTH), *switches]))

    def covariance(self):
        """Covariance of ``NAMES`` at the present solution."""
        return pyomo_fesd.covariance(self.model, self.estimates(), NOISE**2)

    def values(self):
        """Numbers of the estimates, by name."""
        return {name: e.time if name in TIMES else e.value for name, e in self.estimates().items()}


def measure(rows, estimation, cov):
    """Estimate from each sample; one that has its row is not repeated."""
    for number, data in enumerate(samples()):
        if (number,) in rows:
            continue
        begun = time.process_time()
        solver = estimation.solve(data)
        seconds, found = time.process_time() - begun, estimation.values()
        own = deviations(estimation.covariance()) if number < OWN else {}
        _, closed = least_of_closed_form(data)
        usual = deviations(cov)
        rows.add(
            {'sample': number, 'verdict': solver.stationarity, 'misfit': pyo.value(estimation.model.misfit), **found}
            | {f'deviation of {name}': deviation for name, deviation in own.items()}
            | {'distance from the closed form': max(abs(found[name] - closed[name]) / usual[name] for name in TRUTH)}
            | {'seconds': seconds}
        )


def deviations(cov):
    """Standard deviations by name."""
    return {name: float(np.sqrt(cov.loc[name, name])) for name in NAMES}


def summary(table, cov, exact):
    """Per estimate: standard deviations, their ratio with its 95 % interval, the bias, and how often intervals hold the truth."""
    found, freedom = [], len(table) - 1
    for name in NAMES:
        by_covariance, spread = float(np.sqrt(cov.loc[name, name])), table[name].std()
        own = table[f'deviation of {name}']
        ratio = spread / by_covariance
        low, high = (ratio * np.sqrt(freedom / stats.chi2.ppf(p, freedom)) for p in (0.975, 0.025))
        found.append(
            {'estimate': name, 'truth': exact[name], 'covariance': by_covariance, 'Monte Carlo': spread, 'ratio': ratio}
            | {'95 % interval of the ratio': f'{low:.2f} to {high:.2f}'}
            | {'bias in deviations': (table[name].mean() - exact[name]) / by_covariance}
            | {'within 1.96 deviations': ((table[name] - exact[name]).abs() <= 1.96 * by_covariance).mean()}
            | {f'covariance at {own.notna().sum()} samples, least': own.min(), 'largest': own.max()}
        )
    return pd.DataFrame(found)


def overall(table, cov, exact):
    """What concerns all estimates together."""
    names = list(TRUTH)
    errors = table[names].to_numpy() - [exact[name] for name in names]
    chi2 = (errors.T * np.linalg.solve(cov.loc[names, names], errors.T)).sum(axis=0)
    inside = chi2 <= stats.chi2.ppf(0.95, len(TRUTH))
    found = {
        'samples': len(table),
        'certified': (table['verdict'] == 'B').sum(),
        f'mean chi2 of a, b, c, h_0 (expected: {len(TRUTH)})': chi2.mean(),
        'truth inside the 95 % ellipsoid': inside.mean(),
        'largest distance from the closed form, in deviations': table['distance from the closed form'].max(),
        'median CPU seconds of a solve': table['seconds'].median(),
    }
    return pd.Series(found, dtype=object).map(lambda cell: f'{cell:.3g}' if isinstance(cell, float) else str(cell))


def draw(table, cov, exact):
    """The samples of two estimates with both ellipses, and all normalised estimates against the normal distribution."""
    figure = Figure(figsize=(10, 4), layout='constrained')
    plane, normal = figure.subplots(1, 2)
    pair, centre = list(PLANE), np.array([exact[name] for name in PLANE])
    plane.plot(*table[pair].to_numpy().T, '.', color='0.6', markersize=4, label='estimates')
    plane.plot(*_ellipse(centre, cov.loc[pair, pair].to_numpy()), color='C0', label='95 %, covariance')
    plane.plot(*_ellipse(table[pair].mean().to_numpy(), table[pair].cov().to_numpy()), 'C1--', label='95 %, samples')
    plane.set_xlabel('coefficient b')
    plane.set_ylabel('outlet c')
    plane.legend()
    quantiles = stats.norm.ppf((np.arange(len(table)) + 0.5) / len(table))
    for name in NAMES:
        normal.plot(quantiles, np.sort((table[name] - exact[name]) / np.sqrt(cov.loc[name, name])), label=name)
    normal.plot(quantiles, quantiles, color='0.4', linestyle='--', linewidth=0.8)
    normal.set_xlabel('quantile of the normal distribution')
    normal.set_ylabel('error of the estimate / deviation by covariance')
    normal.legend()
    return figure


def _ellipse(centre, cov):
    """The contour that holds 95 % of a normal distribution in the plane."""
    angle = np.linspace(0, 2 * np.pi, 200)
    return centre[:, None] + np.linalg.cholesky(cov) @ np.array([np.cos(angle), np.sin(angle)]) * np.sqrt(stats.chi2.ppf(0.95, 2))


def main():
    """Measure, write the tables and the picture."""
    estimation = Estimation()
    cov, exact = estimation.covariance(), estimation.values()
    measure(Rows(HERE / 'monte_carlo.csv', ('sample',), COLUMNS), estimation, cov)
    table = pd.read_csv(HERE / 'monte_carlo.csv')
    found = summary(table, cov, exact)
    found.to_csv(HERE / 'monte_carlo_summary.csv', index=False, float_format='%.3g')
    draw(table, cov, exact).savefig(HERE / 'monte_carlo.png', dpi=150)
    print(found.to_string())
    whole = overall(table, cov, exact)
    whole.to_csv(HERE / 'monte_carlo_overall.csv', header=False, float_format='%.3g')
    print(whole.to_string())


if __name__ == '__main__':
    main()
