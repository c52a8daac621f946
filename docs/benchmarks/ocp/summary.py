"""Table and picture of the optimal control study from its rows."""

from itertools import product

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
#: Smaller distances from the reference are drawn at this one.
SMALLEST = 1e-10


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
    table['certified'] = table.certified.astype('Int64').where(table.index.get_level_values('method') != 'nosnoc')
    table['cpu / nosnoc'] = ratio(table.cpu, 'nosnoc')
    table = table.map(lambda value: float(f'{value:.{DIGITS}g}') if isinstance(value, float) else value)
    return table.loc[[key for key in product(PROBLEMS, STYLE) if key in table.index]]


def ratio(cpu, method):
    """CPU times as ratios to those of a method."""
    base = cpu[cpu.index.get_level_values('method') == method].droplevel('method')
    return cpu / base.reindex(cpu.index.get_level_values('problem')).to_numpy()


def draw(rows, table):
    """CPU time as a ratio to ours, the share of starts at the reference, and the replayed cost of each start."""
    figure = Figure(figsize=(11, 4), layout='constrained')
    cpu, share, cost = figure.subplots(1, 3, sharey=True)
    problems = list(dict.fromkeys(table.index.get_level_values('problem')))
    for k, (method, style) in enumerate(STYLE.items()):
        heights = pd.Series([row - 0.2 + 0.4 * k for row in range(len(problems))], index=problems)
        part = table.xs(method, level='method').reindex(problems)
        _draw_cpu(cpu, heights, part.cpu, ratio(table.cpu, 'pyomo_fesd').xs(method, level='method').reindex(problems), method)
        _draw_share(share, heights, part['at the reference'], part['starts'], style)
        _draw_cost(cost, heights, rows[rows.method == method], style)
    cpu.set_yticks(range(len(problems)), problems)
    cpu.invert_yaxis()
    cpu.set_xlabel('median CPU time, as a ratio to pyomo_fesd')
    cpu.set_xlim(right=1.25 * cpu.get_xlim()[1])
    cpu.legend()
    share.set_xlabel('share of starts at the reference')
    share.set_xticks([0, 0.5, 1])
    share.set_xlim(right=1.3)
    cost.set_xlabel('replayed cost, distance from the reference')
    cost.set_xscale('log')
    cost.grid(axis='x', color='0.9')
    cost.set_axisbelow(True)
    for axis in (cpu, share, cost):
        axis.spines[['top', 'right']].set_visible(False)
    return figure


def _draw_cpu(axis, heights, cpu, ratios, method):
    bars = axis.barh(heights, ratios.fillna(0), 0.38, edgecolor='0.15', label=method, **STYLE[method])
    axis.bar_label(bars, [f' {s:.2f} s' if s == s else ' cannot state it' for s in cpu], fontsize='small')


def _draw_share(axis, heights, reached, starts, style):
    bars = axis.barh(heights, (reached / starts).fillna(0), 0.38, edgecolor='0.15', **style)
    axis.bar_label(bars, [f' {n:.0f} of {of:.0f}' if of == of else '' for n, of in zip(reached, starts)], fontsize='small')


def _draw_cost(axis, heights, rows, style):
    distances = rows['off replayed'].abs().clip(lower=SMALLEST)
    axis.scatter(distances, heights[rows.problem], s=30, color=style['color'], edgecolor='0.15', linewidth=0.5)


def write(folder):
    """Print and write the table and the picture of the rows in ``folder``."""
    rows = pd.read_csv(folder / 'rows.csv')
    table = summary(rows)
    table.to_csv(folder / 'summary.csv')
    print(table.to_string())
    draw(rows, table).savefig(folder / 'summary.png', dpi=150)
