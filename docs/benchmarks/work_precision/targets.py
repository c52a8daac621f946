"""Targets of the study, and whether its rows meet them."""

import numpy as np
import pandas as pd
from benchmarks.work_precision.charts import order_rows, right
from benchmarks.work_precision.fronts import slope, time_at
from benchmarks.work_precision.runs import NOSNOC, NOSNOCS, ORDERS, OURS, SIMULATE, TIGHT

#: Error -> least ratio of nosnoc's time to ours.
LEVELS = {10.0**-k: 10 if k >= 9 else 5 for k in range(6, 11)}
#: Largest ratios to nosnoc; 'error' is the largest error.
TANK = {'cpu': 0.4, 'error': 1e-3, 'error switch': 1e-3, 'error state': 1e-3}
#: Tolerance of a fitted order below the order of the scheme.
BELOW = 0.25


def write(table, path):
    """Print and write the table of targets that have rows."""
    checks = (tank, oscillator, orders, sensitivity, minima)
    rows = [row for check in checks for row in check(table)]
    if rows:
        result = pd.DataFrame(rows, columns=['target', 'wanted', 'measured', 'verdict'])
        result.to_csv(path, index=False)
        print(result.to_string(index=False))


def _row(target, wanted, measured, met):
    return target, wanted, measured, 'met' if met else 'missed'


def tank(table):
    """Ratios to nosnoc at its defaults, N = 100, Radau 3."""
    rows = table[table['problem'].eq('tank') & table['scheme'].eq('Radau') & table['K'].eq(3) & table['N'].eq(100)]
    rows = rows.set_index('method')
    if {OURS, NOSNOC} <= set(rows.index):
        ratios = rows.loc[OURS, list(TANK)].astype(float) / rows.loc[NOSNOC, list(TANK)].astype(float)
        for name, limit in TANK.items():
            yield _row(f'tank, N = 100: {name} / nosnoc', f'<= {limit:g}', f'{ratios[name]:.2g}', ratios[name] <= limit)
        ratio = rows.loc[OURS, 'cpu'] / rows.loc[TIGHT, 'cpu']
        yield _row('tank, N = 100: cpu / nosnoc at 1e-12', '<= 0.4', f'{ratio:.2g}', ratio <= 0.4)


def oscillator(table):
    """Ratios of the times along the fronts, over all grids and schemes of either tool."""
    rows = table[table['problem'].eq('oscillator')]
    ours, theirs = rows[rows['method'].isin((OURS, SIMULATE))], rows[rows['method'].isin(NOSNOCS)]
    if len(ours) and len(theirs):
        for level, wanted in LEVELS.items():
            mine, other = time_at(ours, level), time_at(theirs, level)
            ratio = other / mine if np.isfinite(mine) else 0.0
            shown = f'{ratio:.1f} ({mine:.2f} s : {other:.2f} s)'
            target = f'oscillator, error {level:.0e}: nosnoc / ours'
            yield _row(target, f'>= {wanted}', shown, ratio >= wanted)


def orders(table):
    """Fitted orders, and numbers of certified runs."""
    for (scheme, K), numbers in ORDERS.items():
        group, order = order_rows(table, scheme, K), 2 * K - (scheme == 'Radau')
        if len(group):
            found = slope(group['N'], group['error state']) if len(group) > 1 else 0.0
            shown = f'{found:.2f}, {len(group)} of {len(numbers)} certified'
            yield _row(f'order of {scheme} {K}', f'{order}', shown, found >= order - BELOW and len(group) == len(numbers))


def sensitivity(table):
    """Largest error of a sensitivity."""
    errors = table.loc[table['problem'].eq('sensitivity') & table['method'].isin((OURS, SIMULATE)), 'error']
    if len(errors):
        worst = errors.fillna(np.inf).max()
        yield _row('dx(T)/dx0 = 1/3: worst error', '<= 1e-8', f'{worst:.1e}', worst <= 1e-8)


def minima(table):
    """Runs that end in false minima, of each method."""
    rows = table[table['problem'].eq('false minima')]
    for method in dict.fromkeys(rows['method']):
        own = rows[rows['method'].eq(method)]
        false = len(own) - right(own)
        wanted, verdict = ('0', 'met' if false == 0 else 'missed') if method == OURS else ('', '')
        yield f'false minima: {method}', wanted, f'{false} of {len(own)}', verdict
