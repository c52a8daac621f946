"""Random MPCCs of eight kinds solved by mpec_hybrid, every claim checked from outside.

    .venv/bin/python docs/benchmarks/random_mpcc/run.py [--count 1000] [--fresh] [--limit SECONDS] [--summary]

Writes rows.csv (every run) and summary.csv (verdicts by kind) beside this file; seeds that have a row are skipped.
"""

import argparse
import logging
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
import pandas as pd
from benchmarks.common.processes import Child, NoAnswer
from benchmarks.common.rows import Rows
from benchmarks.random_mpcc.instances import KINDS, generate
from benchmarks.random_mpcc.judge import FALSE, REFUSED, RIGHT, WRONG, Judge

HERE = Path(__file__).parent
COLUMNS = ('seed', 'kind', 'variables', 'pairs', 'verdict', 'reason', 'outcome', 'objective', 'nlps', 'seconds')
VERDICTS = (RIGHT, REFUSED, FALSE, WRONG)


def solve(seed, **options):
    """The row of one seed: generated, solved and judged."""
    from pyomo.contrib.solver.common.factory import SolverFactory

    import pyomo_fesd  # noqa: F401

    instance = generate(seed)
    row = {'seed': seed, 'kind': instance.kind, 'variables': len(instance.lb)}
    started = time.perf_counter()
    try:
        m = instance.model()
        results = SolverFactory('mpec_hybrid').solve(m, raise_exception_on_nonoptimal_result=False, **options)
    except Exception as error:  # a crash is a row, too
        return row | {'verdict': WRONG, 'reason': f'{type(error).__name__}: {error}', 'outcome': 'crash'}
    info = results.extra_info
    row |= {'pairs': info.pairs, 'outcome': info.outcome, 'objective': results.incumbent_objective, 'nlps': info.nlps}
    row['seconds'] = time.perf_counter() - started
    verdict, reason = Judge(instance).verdict(info.outcome, instance.values(m))
    return row | {'verdict': verdict, 'reason': reason}


def serve(pipe):
    """Answer each seed with its row."""
    warnings.simplefilter('ignore')
    logging.disable(logging.WARNING)
    pipe.send('ready')
    while True:
        pipe.send(solve(pipe.recv()))


def measure(chosen):
    """Run every seed that has no row."""
    rows, child = Rows(HERE / 'rows.csv', ('seed',), COLUMNS, fresh=chosen.fresh), Child(serve)
    for seed in range(chosen.count):
        if (seed,) in rows:
            continue
        child.send(seed)
        try:
            row = child.receive(chosen.limit)
        except NoAnswer as reason:
            row = {'seed': seed, 'kind': [*KINDS][seed % len(KINDS)], 'verdict': REFUSED, 'reason': str(reason)}
        rows.add(row)
        if row['verdict'] != RIGHT:
            print(seed, row['kind'], row['verdict'], row['reason'], flush=True)
    child.stop()


def summarise():
    """Verdicts by kind."""
    rows = pd.read_csv(HERE / 'rows.csv')
    table = pd.crosstab(rows.kind, rows.verdict).reindex(index=[*KINDS], columns=VERDICTS, fill_value=0)
    table.insert(0, 'instances', table.sum(axis=1))
    seconds = rows.groupby('kind').seconds
    table['median s'], table['longest s'] = np.round(seconds.median(), 3), np.round(seconds.max(), 1)
    total = table.sum(numeric_only=True)
    total['median s'], total['longest s'] = np.round(rows.seconds.median(), 3), np.round(rows.seconds.max(), 1)
    table.loc['all'] = total
    table[['instances', *VERDICTS]] = table[['instances', *VERDICTS]].astype(int)
    table.to_csv(HERE / 'summary.csv', index_label='kind', lineterminator='\n')
    print(table.to_string())


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--count', type=int, default=1000)
    parser.add_argument('--fresh', action='store_true')
    parser.add_argument('--limit', type=float, default=120.0)
    parser.add_argument('--summary', action='store_true', help="only summary.csv")
    chosen = parser.parse_args()
    if not chosen.summary:
        measure(chosen)
    summarise()
