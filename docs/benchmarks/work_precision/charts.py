"""Pictures of the work-precision study, from its rows."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from benchmarks.work_precision.fronts import ROUND_OFF, front, slope
from benchmarks.work_precision.runs import (
    BIG_M,
    EVENTS,
    EXACT,
    FIXED,
    NOSNOC,
    ORDERS,
    OURS,
    REFINE,
    SIMULATE,
    SMOOTH,
    STEPS,
    TIGHT,
    TIGHT_STEPS,
)
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator


class Curve(NamedTuple):
    """Methods drawn as one curve; marker and line distinguish curves without colour."""

    methods: tuple
    colour: str
    marker: str
    line: str = '-'


CURVES = {
    'pyomo_fesd': Curve((OURS,), 'C3', 'o'),
    'pyomo_fesd, simulate': Curve((SIMULATE,), 'C1', 'D'),
    'pyomo_fesd, refine': Curve((REFINE,), 'C6', '*'),
    'nosnoc, defaults': Curve((NOSNOC, STEPS), 'C0', 's', '--'),
    'nosnoc, comp_tol=1e-12': Curve((TIGHT, TIGHT_STEPS), 'C9', '^', '-.'),
    'fixed grid': Curve((FIXED,), 'C2', 'v', ':'),
    'smoothing': Curve(SMOOTH, 'C4', 'x', ':'),
    'big-M': Curve((BIG_M,), 'C5', 'P', ':'),
    'events by hand (scipy)': Curve((EVENTS,), '0.5', '.', '--'),
}
#: Label of the error of each problem.
DRAWN = {
    'signum': "error of x(2) and of the switch time",
    'tank': "error of the end state and of the switch time (relative)",
    'oscillator': "error of the end state and of the switch time",
    'sensitivity': "error of dx(2)/dx0 = 1/3",
    'tank control': "error of cost, control, end state, switch (relative)",
    'sliding-mode control': "error of the cost (relative)",
    'friction motor': "error of the cost (relative)",
    'cart-pole': "error of the cost (relative)",
}
#: Least distance of two labels, relative to the height.
SPACING = 0.065


def read(path):
    """The rows, with ``claimed`` as a boolean."""
    table = pd.read_csv(path)
    table['claimed'] = table['claimed'].astype(str).eq('True')
    return table


def draw_all(table, folder):
    """Draw every picture that has rows."""
    for problem in DRAWN:
        rows = table[table['problem'].eq(problem)]
        if len(rows):
            figure = Figure(figsize=(7.5, 4.6), layout='constrained')
            work_precision(figure.subplots(), rows, CURVES)
            figure.savefig(folder / f"{problem.replace(' ', '_')}.png", dpi=150)
    if table['problem'].eq('oscillator').any():
        orders(table).savefig(folder / 'orders.png', dpi=150)
    if table['problem'].eq('false minima').any():
        false_minima(table).savefig(folder / 'false_minima.png', dpi=150)
    if {'oscillator', 'tank', 'false minima'} <= set(table['problem']):
        summary(table).savefig(folder / 'summary.png', dpi=150)


def work_precision(axis, rows, curves):
    """Error against time: all runs as faint points, the front of each method as a labelled line."""
    problem, ends = rows['problem'].iloc[0], []
    axis.set(xscale='log', yscale='log', xlabel='CPU time from model to solution (s)', ylabel=DRAWN[problem])
    for name, curve in curves.items():
        own = rows[rows['method'].isin(curve.methods)]
        times, errors = front(own)
        if not len(times):
            continue
        claimed = own[own['claimed']]
        axis.plot(claimed['cpu'], claimed['error'].clip(lower=ROUND_OFF), curve.marker, color=curve.colour, ms=3, alpha=0.3)
        axis.plot(times, errors, curve.line, marker=curve.marker, color=curve.colour, ms=5, lw=1.4)
        ends.append((name, curve.colour, times[-1], errors[-1]))
    axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.xaxis.set_major_formatter('{x:g}')
    axis.xaxis.set_minor_formatter('')
    axis.tick_params('x', labelsize='small')
    axis.grid(alpha=0.3)
    _label(axis, ends)


def _label(axis, ends):
    """Label the lines in the margin, in the order of their last points."""
    low, high = np.log(axis.get_ylim())
    ends = sorted(ends, key=lambda end: end[3])
    heights = [(np.log(error) - low) / (high - low) for *_, error in ends]
    for (name, colour, time, error), height in zip(ends, spread(heights)):
        axis.annotate(
            name,
            (time, error),
            (1.03, height),
            textcoords='axes fraction',
            color=colour,
            va='center',
            fontsize='small',
            arrowprops={'arrowstyle': '-', 'color': colour, 'lw': 0.6, 'relpos': (0, 0.5)},
            annotation_clip=False,
        )


def spread(heights):
    """Ascending heights with a distance of at least SPACING, within 0 and 1."""
    heights = np.array(heights, float)
    for n in range(1, len(heights)):
        heights[n] = max(heights[n], heights[n - 1] + SPACING)
    ceiling = 1.0
    for n in reversed(range(len(heights))):
        heights[n] = min(heights[n], ceiling)
        ceiling = heights[n] - SPACING
    return heights


def orders(table):
    """Error against the number of elements, with the fitted order of each scheme."""
    figure = Figure(figsize=(9, 4.2), layout='constrained')
    axes = dict(zip(('Radau', 'Gauss'), figure.subplots(1, 2, sharey=True)))
    for scheme, K in ORDERS:
        group = order_rows(table, scheme, K)
        if len(group) < 2:
            continue
        axis, order = axes[scheme], 2 * K - (scheme == 'Radau')
        axis.loglog(group['N'], group['error state'], 'osD^'[K - 1] + '-', color=f'C{K - 1}')
        text = f'K = {K}: slope {slope(group["N"], group["error state"]):.2f} (order {order})'
        last = group.iloc[-1]
        axis.annotate(text, (last['N'], last['error state']), (5, 0), textcoords='offset points', va='center', fontsize='x-small')
    for scheme, axis in axes.items():
        axis.set(title=f'{scheme}, oscillator', xlabel='number of elements N', xlim=(8, 60000 if scheme == 'Radau' else 12000))
        axis.grid(alpha=0.3)
    axes['Radau'].set_ylabel('error of the end state')
    return figure


def order_rows(table, scheme, K):
    """The certified runs that show the order of one scheme."""
    mine = table['problem'].eq('oscillator') & table['method'].eq(OURS) & table['scheme'].eq(scheme) & table['K'].eq(K)
    return table[mine & table['N'].isin(ORDERS[scheme, K]) & table['claimed']].sort_values('N')


def false_minima(table):
    """Result of each of the 50 starts, a panel for each method."""
    rows = table[table['problem'].eq('false minima')]
    names = [name for name, curve in MINIMA.items() if rows['method'].eq(curve).any()]
    figure, minimum = Figure(figsize=(10, 3.2), layout='constrained'), EXACT['false minima']['x0']
    for axis, name in zip(figure.subplots(1, len(names), sharey=True, squeeze=False)[0], names):
        own = rows[rows['method'].eq(MINIMA[name])]
        axis.axhspan(minimum - NEAR, minimum + NEAR, color='0.85')
        axis.set_xticks((-2, -1.5, -1))
        axis.plot(own['start'], own['x0'], 'k.', ms=4)
        axis.set_title(f'{name}\n{right(own)} of {len(own)} right', fontsize='small')
        axis.set_xlabel('start of $x_0$')
        axis.grid(alpha=0.3)
    figure.axes[0].set_ylabel('$x_0$ found (grey: the minimum)')
    return figure


MINIMA = {
    'pyomo_fesd': OURS,
    'nosnoc': NOSNOC,
    'nosnoc, 1e-12': TIGHT,
    'fixed grid': FIXED,
    'smoothing, tanh 1e-2': SMOOTH[0],
    'smoothing, sqrt 1e-2': SMOOTH[1],
}
#: Distance to the minimum within which a result counts as right, given the error of a grid.
NEAR = 0.05


def right(rows):
    """How many runs ended at the minimum."""
    return int(((rows['x0'] - EXACT['false minima']['x0']).abs() <= NEAR).sum())


def summary(table):
    """The main results: accuracy against time on two problems, and false minima."""
    figure = Figure(figsize=(12.5, 4.4), layout='constrained')
    axes = figure.subplots(1, 3, width_ratios=(1, 1, 0.75))
    for axis, problem, title in zip(
        axes, ('oscillator', 'tank'), ('a switch is crossed (oscillator)', 'a slide is entered (tank)')
    ):
        work_precision(axis, table[table['problem'].eq(problem)], COMBINED)
        axis.set_ylabel('error of end state and switch time')
        axis.set_title(title)
    _shares(axes[2], table[table['problem'].eq('false minima')])
    return figure


COMBINED = {
    'pyomo_fesd': Curve((OURS, SIMULATE), 'C3', 'o'),
    'nosnoc': Curve((NOSNOC, STEPS, TIGHT, TIGHT_STEPS), 'C0', 's', '--'),
    'fixed grid': CURVES['fixed grid'],
    'smoothing': CURVES['smoothing'],
    'big-M': CURVES['big-M'],
}


def _shares(axis, rows):
    """Share of the starts that end at the minimum."""
    names = [name for name, method in MINIMA.items() if rows['method'].eq(method).any()]
    own = [rows[rows['method'].eq(MINIMA[name])] for name in names]
    shares = [100 * right(r) / len(r) for r in own]
    bars = axis.barh(names, shares, color=['C3', 'C0', 'C9', 'C2', 'C4', 'C4'][: len(names)])
    axis.bar_label(bars, [f'{share:.0f} %' for share in shares], padding=3)
    axis.invert_yaxis()
    axis.set(xlim=(0, 140), xlabel='right answers (%)', title='one minimum, 50 starts')
