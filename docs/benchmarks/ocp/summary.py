"""Table and picture of the optimal control study from its rows."""

import pandas as pd
from matplotlib.figure import Figure

PROBLEMS = ('sliding', 'motor', 'cartpole', 'tank', 'gearbox', 'ellipse')
#: A run has found the reference minimum if its objective is this near, relative; the rest is the error of the grid.
SAME = 0.03
STYLE = {'pyomo_fesd': {'color': '0.15', 'hatch': ''}, 'nosnoc': {'color': '0.75', 'hatch': '//'}}
#: Status of a solution, of both methods.
SOLVED = ('optimal', 'SUCCESS')
MEDIANS = ('objective', 'off', 'replayed', 'off replayed', 'missed', 'iterations', 'nlps', 'cpu')
DIGITS = 6


def summary(rows):
    """One row for each problem and method: numbers of starts, and medians over the starts."""
    of_run = {
        'solved': rows.status.isin(SOLVED),
        'certified': rows.certified.eq(True),
        'at the reference': rows.off.abs().le(SAME) & rows.status.isin(SOLVED),
    }
    groups = rows.assign(**of_run).groupby(['problem', 'method'])
    table = groups.size().to_frame('starts').join(groups[list(of_run)].sum()).join(groups[list(MEDIANS)].median())
    # nosnoc does not certify
    table['certified'] = table.certified.where(table.index.get_level_values('method') != 'nosnoc')
    table = table.reindex(pd.MultiIndex.from_product([PROBLEMS, STYLE], names=table.index.names)).dropna(how='all')
    table['cpu / nosnoc'] = ratio(table.cpu, 'nosnoc')
    return table.map(lambda value: float(f'{value:.{DIGITS}g}'))


def ratio(cpu, method):
    """CPU times as ratios to those of a method."""
    base = cpu[cpu.index.get_level_values('method') == method].droplevel('method')
    return cpu / base.reindex(cpu.index.get_level_values('problem')).to_numpy()


def draw(table):
    """CPU time as a ratio to ours, and the share of starts at the reference."""
    figure = Figure(figsize=(9, 4), layout='constrained')
    left, right = figure.subplots(1, 2, sharey=True)
    problems, ratios = list(dict.fromkeys(table.index.get_level_values('problem'))), ratio(table.cpu, 'pyomo_fesd')
    for k, (method, style) in enumerate(STYLE.items()):
        part = table.xs(method, level='method').reindex(problems)
        heights = [row - 0.2 + 0.4 * k for row in range(len(problems))]
        widths = ratios.xs(method, level='method').reindex(problems).fillna(0)
        bars = left.barh(heights, widths, 0.38, edgecolor='0.15', label=method, **style)
        left.bar_label(bars, [f' {s:.2f} s' if s == s else ' cannot state it' for s in part.cpu], fontsize='small')
        share = part['at the reference'] / part['starts']
        bars = right.barh(heights, share.fillna(0), 0.38, edgecolor='0.15', **style)
        labels = [f' {n:.0f} of {of:.0f}' if of == of else '' for n, of in zip(part['at the reference'], part['starts'])]
        right.bar_label(bars, labels, fontsize='small')
    left.set_yticks(range(len(problems)), problems)
    left.invert_yaxis()
    left.set_xlabel('median CPU time, as a ratio to pyomo_fesd')
    right.set_xlabel('starts that end at the reference')
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
