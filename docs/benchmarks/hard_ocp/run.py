"""Hard optimal control problems: pyomo_fesd at its defaults in its forms, beside nosnoc 0.2.0 with the settings of its examples.

    .venv/bin/pip install nosnoc==0.2.0
    .venv/bin/python docs/benchmarks/hard_ocp/run.py [--only carts,discs] [--methods contact,nosnoc] [--fresh] [--limit 180]
    .venv/bin/python docs/benchmarks/hard_ocp/run.py --case discs --form contact --seed 0 --options relaxation=scholtes eps_init=10

The first command measures the missing rows, each in a process of its own: seed 0 starts from the model's own values, the others
from random controls.  It writes rows.csv, one row a run, then summary.csv and summary.png beside this file.  The second solves one
case and prints one line.
"""

import argparse
import ast
import os
import sys
from pathlib import Path

# CPU seconds are compared: one thread each
os.environ.setdefault('OMP_NUM_THREADS', '1')
sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from benchmarks.hard_ocp import cases, summary

HERE = Path(__file__).parent
SEEDS = 5
KEY = ('problem', 'method', 'seed')
FOUND = (
    'status',
    'certified',
    'objective',
    'replayed',
    'missed',
    'excess',
    'impacts',
    'iterations',
    'nlps',
    'build',
    'cpu',
    'seconds',
)
COLUMNS = (*KEY, 'limit', *FOUND, 'residual', 'status of replay', 'better')


def in_process(problem, method, seed, options, limit):
    """Measure one case in a process of its own; a dict."""
    given = [f'{name}={value!r}' for name, value in options.items()]
    arguments = ('--case', problem, '--form', method, '--seed', seed, '--limit', limit, '--options', *given)
    lines, status = json_lines(__file__, *arguments, limit=2 * cases.KILL * limit)
    row = {'problem': problem, 'method': method, 'seed': seed, 'limit': limit}
    return row | (lines[-1] if lines else {'status': died(status, limit)})


def died(status, limit):
    """Why a process gave no answer; one that is killed at its limit leaves no message."""
    return f'no answer in {cases.KILL * limit + 30:g} CPU s' if status == 'failed without a message' else status


def study(problems, methods, seeds, limit, fresh):
    """Measure the missing rows, all methods of a problem and seed one after the other."""
    rows = Rows(HERE / 'rows.csv', KEY, COLUMNS, fresh=fresh)
    for seed in range(seeds):
        for problem in problems:
            for method in (*cases.module(problem).FORMS, 'nosnoc'):
                if method in methods and (problem, method, seed) not in rows:
                    row = in_process(problem, method, seed, {}, limit)
                    rows.add(row)
                    show(row)


def show(row):
    """Print a row on one line."""
    print(' '.join(str(round(v, 5) if isinstance(v, float) else v) for v in row.values()), flush=True)


def option(text):
    """'name=value' as a pair; the value is a Python literal or a string."""
    name, _, value = text.partition('=')
    try:
        return name, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return name, value


def names(text):
    """Names with commas between."""
    return text.split(',')


def main():
    """Solve one case, or measure the missing rows and write the summary and the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', type=names, default=cases.PROBLEMS, help="problems, by name")
    parser.add_argument('--methods', type=names, default=tuple(summary.METHODS), help="contact, time_freezing, nosnoc")
    parser.add_argument('--seeds', type=int, default=SEEDS, help="number of starts")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--limit', type=float, default=180, help="seconds for each run")
    parser.add_argument('--summary', action='store_true', help="run nothing")
    parser.add_argument('--case', help="solve this problem only, and print one line")
    parser.add_argument('--form', default='contact', help="of the case: contact, time_freezing, or nosnoc")
    parser.add_argument('--seed', type=int, default=0, help="of the case")
    parser.add_argument('--options', nargs='*', type=option, default=[], help="of the case: name=value of the solver or the grid")
    parser.add_argument('--tee', action='store_true', help="print the log of the case")
    chosen = parser.parse_args()
    if chosen.case:
        cases.print_case(chosen.case, chosen.form, chosen.seed, dict(chosen.options), chosen.limit, chosen.tee)
        return
    if not chosen.summary:
        study(chosen.only, chosen.methods, chosen.seeds, chosen.limit, chosen.fresh)
    summary.write(HERE)


if __name__ == '__main__':
    main()
