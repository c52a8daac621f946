"""Tables and picture of the MPCC study from its rows.

Reads SET.csv, one row for each instance and method; writes SET_summary.csv (a column for each method), SET_exceptions.csv
(instances on which ``hybrid`` failed, was not confirmed, or found a worse minimum) and SET.png (performance profile).
"""

import numpy as np
import pandas as pd
from cycler import cycler
from matplotlib import rcParams
from matplotlib.figure import Figure

#: Shifts of the geometric means: one second, ten Ipopt iterations.
SECOND, ITERATIONS = 1.0, 10.0
#: As good as the reference: difference relative to max(1, |reference|); as good as scholtes: relative and absolute.
GOOD, SAME, ABSOLUTE = 1e-3, 1e-4, 1e-6
#: Correct status of hybrid for an instance without any known feasible point.
INFEASIBLE = 'locallyInfeasible'


def read(path):
    """The rows, the last of each run, with booleans; ``known`` tells whether any feasible point of the instance is known."""
    table = pd.read_csv(path).drop_duplicates(['set', 'instance', 'method'], keep='last')
    for name in ('certified', 'solved', 'b_stationary'):
        table[name] = table[name].astype(str).eq('True')
    table['known'] = (table['solved'] | table['best_known'].notna()).groupby(table['instance']).transform('any')
    return table


def shifted_mean(values, shift):
    """exp(mean(log(v + shift))) - shift."""
    return np.exp(np.log(values + shift).mean()) - shift


def summary(table):
    """A column of figures for each method."""
    known = table[table['known']]
    hybrid = known[known['method'].eq('hybrid') & known['solved']].set_index('instance')
    return pd.DataFrame({m: _counts(rows) | _work(rows, hybrid) for m, rows in known.groupby('method', sort=False)})


def _counts(rows):
    """Numbers of instances that a method solves."""
    solved, certified = rows[rows['solved']], rows[rows['certified']]
    gap = rows.loc[rows['solved'], 'gap'].dropna()
    return {
        'instances with a known feasible point': len(rows),
        'solved': len(solved),
        'of these B-stationary': solved['b_stationary'].sum(),
        'certified by itself': len(certified),
        'of these confirmed': certified['b_stationary'].sum(),
        'least LPEC value of certified points': certified['lpec_value'].min(),
        'instances with a reference': rows['best_known'].notna().sum(),
        f'solved, within {GOOD:g} of it': (gap <= GOOD).sum(),
        f'solved, within {SAME:g} of it': (gap <= SAME).sum(),
        'median complementarity': solved['complementarity'].median(),
    }


def _work(rows, hybrid):
    """Work of a method; ratios on the instances that both hybrid and the method solve."""
    both = rows[rows['solved']].set_index('instance')
    both = both.loc[both.index.intersection(hybrid.index)]
    same = hybrid.loc[both.index]
    return {
        'NLPs per instance': rows['nlps'].mean(),
        'Ipopt iterations per instance': rows['iterations'].mean(),
        'share of time in LPECs, all': rows['lpec'].sum(min_count=1) / rows['total'].sum(),
        'share of time in LPECs, median': (rows['lpec'] / rows['total']).median(),
        'solved by hybrid too': len(both),
        'CPU time there (shifted mean, s)': shifted_mean(both['time'], SECOND),
        'hybrid / method: CPU time': shifted_mean(same['time'], SECOND) / shifted_mean(both['time'], SECOND),
        'hybrid / method: CPU time of all together': same['time'].sum() / both['time'].sum(),
        'hybrid / method: CPU time, geometric mean': np.exp(np.log(same['time'] / both['time']).mean()),
        'hybrid / method: iterations': shifted_mean(same['iterations'], ITERATIONS) / shifted_mean(both['iterations'], ITERATIONS),
    }


def exceptions(table):
    """Instances on which hybrid failed, was wrong or was worse than others, with a figure."""
    by_method = {method: rows.set_index('instance') for method, rows in table.groupby('method')}
    found = []
    for name, row in by_method.pop('hybrid', table[:0].set_index('instance')).iterrows():
        others = {method: rows.loc[name] for method, rows in by_method.items() if name in rows.index}
        found += [(name, what, figure, row['status']) for what, figure in _wrong(row, others)]
    return pd.DataFrame(found, columns=['instance', 'what', 'figure', 'status'])


def _wrong(row, others):
    """Defects of one row of hybrid, given the rows of the other methods."""
    if pd.notna(row['error']):
        yield row['error'], np.nan
    if not row['known']:
        yield 'no feasible point known' + ('' if row['status'] == INFEASIBLE else f', but not {INFEASIBLE}'), row['violation']
        return
    if not row['solved']:
        yield f"not solved, by: {' '.join(m for m, other in others.items() if other['solved']) or 'none'}", row['violation']
        return
    if not row['certified']:
        yield 'not certified', row['lpec_value']
    elif not row['b_stationary']:
        yield 'certified, not confirmed', row['lpec_value']
    yield from _worse(row, others.get('scholtes'))


def _worse(row, scholtes):
    """Defects of the minimum that hybrid found."""
    if row['gap'] > SAME:
        yield f"worse than the reference by more than {GOOD if row['gap'] > GOOD else SAME:g}", row['gap']
    if scholtes is not None and scholtes['solved']:
        worse = (row['objective'] - scholtes['objective']) * row['sense']
        if worse > max(SAME * abs(scholtes['objective']), ABSOLUTE):
            yield 'worse than scholtes', worse


def profile(table):
    """Share of instances that each method solves (B-stationary) within a factor of the fastest method."""
    known = table[table['known']]
    methods = known['method'].unique()
    figure = Figure(figsize=(6, 4 + 0.12 * len(methods)), layout='constrained')
    axis = figure.subplots()
    axis.set_prop_cycle(cycler(linestyle=['-', '--', ':']) * rcParams['axes.prop_cycle'])
    times = known['time'].where(known['solved'] & known['b_stationary'])
    times = known.assign(time=times).pivot(index='instance', columns='method', values='time')[methods]
    ratios = times.div(times.min(axis=1), axis=0)
    end = 2 * ratios.max(axis=None)
    for method in ratios:
        reached = np.sort(ratios[method].dropna())
        share = np.arange(len(reached) + 1) / len(ratios)
        axis.step([1, *reached, end], [*share, share[-1]], where='post', label=method)
    axis.set_xscale('log', base=2)
    axis.set_xlim(1, end)
    axis.set_ylim(0, 1.02)
    axis.set_xlabel('CPU time / CPU time of the fastest')
    axis.set_ylabel('share of instances solved, B-stationary')
    figure.legend(loc='outside lower center', ncols=2, fontsize='small')
    axis.grid(alpha=0.3)
    return figure


def write(path):
    """Print and write tables and picture of the rows in ``path``."""
    table = read(path)
    figures, failures = summary(table), exceptions(table)
    print(f"\n{path.name}\n{figures.to_string(float_format='{:.4g}'.format)}\n\n{failures.to_string(index=False)}")
    stem = path.with_suffix('')
    figures.rename_axis('').to_csv(f'{stem}_summary.csv', float_format='%.3g')
    failures.to_csv(f'{stem}_exceptions.csv', index=False, float_format='%.3g')
    profile(table).savefig(f'{stem}.png', dpi=150)
