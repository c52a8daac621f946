"""Table and picture of the optimal control study from its rows."""

import pandas as pd
from matplotlib.figure import Figure

PROBLEMS = ('sliding', 'motor', 'cartpole', 'tank', 'gearbox', 'ellipse')
#: A run has found the reference minimum if its objective is this near, relative; the rest is the error of the grid.
SAME = 0.03
STYLE = {'pyomo_fesd': {'color': '0.15', 'hatch': ''}, 'nosnoc': {'color': '0.75', 'hatch': '//'}}


def summary(rows):
    """One row for each problem and method: medians of the timed runs, and the share of starts that end at the reference."""
    rows = rows.assign(reached=(rows.off.abs() <= SAME))
    timed, starts = rows[rows.run == 'time'], rows[rows.run == 'start']
    table = timed.groupby(['problem', 'method']).agg(
        seconds=('seconds', 'median'),
        iterations=('iterations', 'median'),
        nlps=('nlps', 'median'),
        status=('status', 'first'),
        certified=('certified', 'first'),
        objective=('objective', 'first'),
        off=('off', 'first'),
        missed=('missed', 'first'),
    )
    table['starts'] = starts.groupby(['problem', 'method']).size()
    table['starts at the reference'] = starts.groupby(['problem', 'method']).reached.sum()
    ours = table.seconds.xs('pyomo_fesd', level='method')
    table['time / ours'] = table.seconds / ours.reindex(table.index.get_level_values('problem')).to_numpy()
    table = table.reindex(pd.MultiIndex.from_product([PROBLEMS, STYLE], names=table.index.names)).dropna(how='all')
    return table.map(lambda value: float(f'{value:.6g}') if isinstance(value, float) else value)


def draw(table):
    """Time as a ratio to ours, and the share of starts at the reference."""
    figure = Figure(figsize=(9, 4), layout='constrained')
    left, right = figure.subplots(1, 2, sharey=True)
    problems = list(dict.fromkeys(table.index.get_level_values('problem')))
    for k, (method, style) in enumerate(STYLE.items()):
        part = table.xs(method, level='method').reindex(problems)
        heights = [row - 0.2 + 0.4 * k for row in range(len(problems))]
        bars = left.barh(heights, part['time / ours'].fillna(0), 0.38, edgecolor='0.15', label=method, **style)
        left.bar_label(bars, [f' {s:.2f} s' if s == s else ' cannot state it' for s in part.seconds], fontsize='small')
        share = part['starts at the reference'] / part['starts']
        bars = right.barh(heights, share.fillna(0), 0.38, edgecolor='0.15', **style)
        labels = [f' {n:.0f} of {of:.0f}' if of == of else '' for n, of in zip(part['starts at the reference'], part['starts'])]
        right.bar_label(bars, labels, fontsize='small')
    left.set_yticks(range(len(problems)), problems)
    left.invert_yaxis()
    left.set_xlabel('total time, as a ratio to pyomo_fesd')
    right.set_xlabel('random starts that end at the reference')
    for axis in (left, right):
        axis.set_xlim(right=1.25 * axis.get_xlim()[1])
        axis.spines[['top', 'right']].set_visible(False)
    left.legend()
    return figure


def write(folder):
    """Print and write the table and the picture of the rows in ``folder``."""
    table = summary(pd.read_csv(folder / 'rows.csv'))
    table.to_csv(folder / 'summary.csv')
    print(table.to_string())
    draw(table).savefig(folder / 'summary.png', dpi=150)
