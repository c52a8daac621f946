"""Table and picture of the study of hard optimal control problems, from its rows."""

import pandas as pd
from benchmarks.hard_ocp.cases import PROBLEMS
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

#: Marker and colour of each method.
METHODS = {
    'contact': {'marker': 'o', 'color': '0.15'},
    'time_freezing': {'marker': 's', 'color': '0.5'},
    'nosnoc': {'marker': '^', 'color': 'tab:red'},
}
#: What a problem asks for beyond its cost is met to this accuracy in the replay.
MET = 0.05


def summary(rows):
    """One row for each problem and method: medians over the seeds, numbers of runs, and ratios to nosnoc."""
    rows = rows.assign(answered=rows.objective.notna(), certified=rows.certified.eq(True), met=rows.missed.le(MET))
    groups = rows.groupby(['problem', 'method'])
    table = groups.agg(
        runs=('seed', 'size'),
        answers=('answered', 'sum'),
        certified=('certified', 'sum'),
        met=('met', 'sum'),
        objective=('objective', 'median'),
        replayed=('replayed', 'median'),
        best=('replayed', 'min'),
        missed=('missed', 'median'),
        impacts=('impacts', 'median'),
        iterations=('iterations', 'median'),
        cpu=('cpu', 'median'),
    )
    table['success'] = rows[rows.status.isin(['optimal', 'SUCCESS'])].groupby(['problem', 'method']).size()
    table['success'] = table['success'].fillna(0).astype(int)
    theirs = (
        table.cpu.xs('nosnoc', level='method') if 'nosnoc' in table.index.get_level_values('method') else pd.Series(dtype=float)
    )
    table['cpu / nosnoc'] = table.cpu / theirs.reindex(table.index.get_level_values('problem')).to_numpy()
    table['as good / nosnoc'] = seconds_until_as_good(rows).groupby(level=['problem', 'method']).median()
    table = table.reindex(pd.MultiIndex.from_product([PROBLEMS, METHODS], names=table.index.names)).dropna(how='all')
    return table.map(lambda value: float(f'{value:.4g}') if isinstance(value, float) else value)


def seconds_until_as_good(rows):
    """CPU seconds until a run has a point whose objective is at most the true cost of nosnoc's, as parts of nosnoc's seconds.

    By problem, method and seed; infinite where it never has.
    """
    theirs = rows[rows.method.eq('nosnoc')].set_index(['problem', 'seed'])
    ratios = {}
    for run in rows[rows.better.notna()].itertuples():
        if (run.problem, run.seed) in theirs.index:
            other = theirs.loc[run.problem, run.seed]
            points = (map(float, point.split(':')) for point in run.better.split())
            seconds = next((seconds for seconds, objective in points if objective <= other.replayed), float('inf'))
            ratios[run.problem, run.method, run.seed] = seconds / other.cpu
    return pd.Series(ratios, dtype=float, index=pd.MultiIndex.from_tuples(ratios, names=['problem', 'method', 'seed']))


def failures(rows):
    """The runs that are not certified (ours) or not SUCCESS (nosnoc), or whose replay misses what the problem asks for."""
    good = rows.certified.eq(True) | rows.status.eq('SUCCESS')
    bad = rows[~good | ~rows.missed.le(MET)]
    table = bad[['problem', 'method', 'seed', 'status', 'objective', 'replayed', 'missed', 'cpu']]
    # the page cannot show a table without rows
    return table if len(table) else pd.DataFrame([{column: 'none' if column == 'problem' else '' for column in table}])


def draw(rows):
    """CPU seconds and replayed cost of each run; runs without success or a certificate are hollow."""
    figure = Figure(figsize=(9, 4), layout='constrained')
    axes = figure.subplots(1, 2, sharey=True)
    for axis, column, label in zip(axes, ('cpu', 'replayed'), ('CPU seconds', 'cost of the replayed controls')):
        for k, (method, style) in enumerate(METHODS.items()):
            part = rows[rows.method == method]
            places = [PROBLEMS.index(problem) + 0.22 * (k - 1) for problem in part.problem]
            colors = [style['color'] if good else 'none' for good in part.certified.eq(True) | part.status.eq('SUCCESS')]
            axis.scatter(part[column], places, label=method, marker=style['marker'], facecolors=colors, edgecolors=style['color'])
        axis.set_yticks(range(len(PROBLEMS)), PROBLEMS)
        axis.set_ylim(len(PROBLEMS) - 0.5, -0.5)
        axis.set_xscale('log')
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_xlabel(label)
        axis.grid(axis='x', color='0.9')
        axis.spines[['top', 'right']].set_visible(False)
    handles = [Line2D([], [], linestyle='', label=method, **style) for method, style in METHODS.items()]
    figure.legend(handles=handles, loc='outside upper center', ncols=len(METHODS), frameon=False)
    return figure


def write(folder):
    """Print and write the tables and the picture of the rows in ``folder``."""
    rows = pd.read_csv(folder / 'rows.csv')
    table = summary(rows)
    table.to_csv(folder / 'summary.csv')
    failures(rows).to_csv(folder / 'failures.csv', index=False)
    print(table.to_string())
    draw(rows).savefig(folder / 'summary.png', dpi=150)
