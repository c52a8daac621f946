"""Options of ``mpec_hybrid`` compared: table and picture from the rows of ``docs/benchmarks/mpcc/run.py``.

    python docs/benchmarks/solver_options/run.py

Reads macmpec.csv and nosbench.csv beside this file (docs/benchmarks/solver_options/index.rst has the commands that write them);
writes summary.csv, one row for each set and method, and summary.png.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
import pandas as pd
from benchmarks.mpcc.summary import GOOD, ITERATIONS, SECOND, read, shifted_mean
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MultipleLocator, PercentFormatter

HERE = Path(__file__).parent
SETS = {'macmpec': 'MacMPEC', 'nosbench': 'nosbench'}
DEFAULT = 'hybrid'
COLOURS = {
    'default': 'black',
    'relaxation': 'C0',
    'lpec': 'C1',
    'nlp_solver': 'C2',
    'starts': 'C3',
    'mode': 'C4',
    'warm_start': 'C5',
}
#: Least distance of two labels, relative to the height of the axis; position of the labels, relative to its width.
SPACING, MARGIN = 0.056, 1.04


def compare(table):
    """One row for each method."""
    table = table[table['known']]
    best, default = least(table), table[table['method'].eq(DEFAULT)].set_index('instance')
    return pd.DataFrame(
        [_figures(method, rows.set_index('instance'), default, best) for method, rows in table.groupby('method', sort=False)]
    )


def least(table):
    """The best objective, to be minimised, of all B-stationary points of each instance."""
    reached = table[table['solved'] & table['b_stationary']]
    return (reached['objective'] * reached['sense']).groupby(reached['instance']).min()


def _figures(method, rows, default, best):
    """Successes of a method, and its work relative to the default on the instances that both solve."""
    reference = best.reindex(rows.index)
    good = rows['objective'] * rows['sense'] - reference <= GOOD * np.maximum(1, reference.abs())
    both = rows.index[rows['solved'] & default['solved'].reindex(rows.index)]

    def ratio(name, shift):
        return shifted_mean(rows.loc[both, name], shift) / shifted_mean(default.loc[both, name], shift)

    return {
        'method': 'default' if method == DEFAULT else method.partition(':')[2],
        'instances': len(rows),
        'solved': rows['solved'].sum(),
        'certified': rows['certified'].sum(),
        'confirmed': (rows['certified'] & rows['b_stationary']).sum(),
        'best': (rows['solved'] & good).sum(),
        'iterations': round(rows['iterations'].mean()),
        'iterations / default': ratio('iterations', ITERATIONS),
        'time / default': ratio('time', SECOND),
    }


def picture(table):
    """Share of best minima against time, a point for each method, a panel for each set."""
    figure = Figure(figsize=(8, 9.5), layout='constrained')
    for axis, (title, rows) in zip(figure.subplots(len(SETS)), table.groupby('set', sort=False)):
        _panel(axis, title, rows)
    return figure


def _panel(axis, title, rows):
    """Draw the points, each with a line to its label in the margin."""
    times, shares = rows['time / default'], rows['best'] / rows['instances']
    axis.set(title=title, xlabel='time / time of the default', ylabel='share of instances with the best minimum')
    axis.set(xscale='log', xlim=(times.min() / 1.1, times.max() * 1.1), ylim=(shares.min() - 0.02, 1.01))
    axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.xaxis.set_major_formatter('{x:g}')
    axis.xaxis.set_minor_formatter('')
    axis.yaxis.set_major_locator(MultipleLocator(0.05))
    axis.yaxis.set_major_formatter(PercentFormatter(1, decimals=0))
    axis.grid(alpha=0.3)
    points = (axis.transData + axis.transAxes.inverted()).transform(np.column_stack([times, shares]))
    for method, point, height in zip(rows['method'], points, _heights(points)):
        _label(axis, method, point, height)


def _label(axis, method, point, height):
    """Draw one point and its label."""
    colour = COLOURS[method.partition('=')[0]]
    line = {'arrowstyle': '-', 'color': colour, 'lw': 0.6, 'relpos': (0, 0.5)}
    axis.plot(*point, 'o', color=colour, transform=axis.transAxes)
    axis.annotate(method, point, (MARGIN, height), 'axes fraction', color=colour, va='center', arrowprops=line)


def _heights(points):
    """Heights of the labels: SPACING apart, in an order in which the lines do not cross."""
    order = np.argsort(points[:, 1], kind='stable')
    slots = points[order, 1]
    for _ in range(200):
        for i in range(len(slots) - 1):
            push = max(0, SPACING - (slots[i + 1] - slots[i])) / 2
            slots[i], slots[i + 1] = slots[i] - push, slots[i + 1] + push
        slots = np.clip(slots, 0, 1)
    for _ in order:
        for i in range(len(slots) - 1):
            if _cross(points[order[i]], points[order[i + 1]], *slots[i : i + 2]):
                order[i], order[i + 1] = order[i + 1], order[i]
    heights = np.empty(len(slots))
    heights[order] = slots
    return heights


def _cross(a, b, low, high):
    """Whether the lines from point a to the label at ``low`` and from b to the one above it, at ``high``, cross."""
    if a[0] < b[0]:
        return a[1] + (low - a[1]) * (b[0] - a[0]) / (MARGIN - a[0]) > b[1]
    return b[1] + (high - b[1]) * (a[0] - b[0]) / (MARGIN - b[0]) < a[1]


def main():
    """Write the table and the picture."""
    parts = [compare(read(HERE / f'{name}.csv')).assign(set=title) for name, title in SETS.items()]
    table = pd.concat(parts)
    table.insert(0, 'set', table.pop('set'))
    print(table.to_string(index=False, float_format='{:.2f}'.format))
    table.to_csv(HERE / 'summary.csv', index=False, float_format='%.2f')
    picture(table).savefig(HERE / 'summary.png', dpi=150)


if __name__ == '__main__':
    main()
