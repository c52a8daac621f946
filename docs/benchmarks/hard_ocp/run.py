"""Hard optimal control problems."""

import argparse
import importlib
import json
import os
import sys
import time
from pathlib import Path

# one thread for everybody: CPU seconds are compared
os.environ.setdefault('OMP_NUM_THREADS', '1')
sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from benchmarks.hard_ocp import replay


def module(case):
    """The model file of a problem."""
    return importlib.import_module(f'benchmarks.hard_ocp.{case}')


def guess(p, seed):
    """Guessed controls of all stages; None, for seed 0, means the model's own."""
    if seed == 0:
        return None
    low, high = p.U_RANGE
    return 0.1 * np.random.default_rng(seed).uniform(low, high, (p.STAGES, p.CONTROLS))


def initialise(p, m, given):
    """Set the guessed controls."""
    from benchmarks.hard_ocp import grid

    ends = grid.ends(p.HORIZON, p.STAGES)[1:]
    for t in m.t:
        row = given[int(np.searchsorted(ends, t - 1e-9))]
        parts = [m.u[t]] if p.CONTROLS == 1 else [m.u[j + 1, t] for j in range(p.CONTROLS)]
        for part, value in zip(parts, row):
            part.set_value(float(value), skip_validation=True)


def replayed(p, used):
    """Cost of controls in the replay, what they miss, and the number of impacts."""
    try:
        out = replay.replay(p.PLANT, p.AT_START, used, np.full(p.STAGES, p.HORIZON / p.STAGES))
    except RuntimeError as error:
        return {'replay': str(error)[:80]}
    return {'replayed': float(out.cost + p.final_cost(out.q, out.v)), 'missed': p.missed(out), 'impacts': len(out.impacts)}


GRID = ('equilibration', 'cross_complementarity', 'ncp', 'rho', 'length_bounds', 'elements', 'clock', 'no_slip', 'guess', 'scheme')


def split(options):
    """Options of the grid, and of the solver."""
    grid, solver = {}, {}
    for name, value in options.items():
        if name in GRID:
            grid[name] = value
        elif '.' in name:
            group, key = name.split('.')
            solver.setdefault(group, {})[key] = value
        else:
            solver[name] = value
    return grid, solver


def with_pyomo_fesd(p, form, seed, options, limit, tee=False):
    """Build and solve; return the row."""
    import pyomo.environ as pyo

    import pyomo_fesd  # noqa: F401

    on_grid, on_solver = split(options)
    started, cpu = time.perf_counter(), time.process_time()
    m = p.build(form, **on_grid)
    given = guess(p, seed)
    if given is not None:
        initialise(p, m, given)
    built = time.process_time() - cpu
    results = pyo.SolverFactory('mpec_hybrid').solve(m, time_limit=limit, tee=tee, load_solutions=True, **on_solver)
    row = {
        'status': str(results.solver.termination_condition),
        'certified': str(results.solver.stationarity) == 'B',
        'objective': pyo.value(m.cost),
        'iterations': int(results.solver.nlp_iterations),
        'nlps': int(results.solver.nlps),
        'build': built,
        'cpu': time.process_time() - cpu,
        'seconds': time.perf_counter() - started,
    }
    return row | replayed(p, p.controls(m))


def with_nosnoc(p, seed):
    """Build and solve the twin; return the row."""
    from benchmarks.hard_ocp import nosnoc_peer

    started = time.perf_counter()
    row = nosnoc_peer.solve(p, guess(p, seed))
    return {'seconds': time.perf_counter() - started} | row | replayed(p, row['u'])


def option(text):
    """name=value; the value is a Python literal or a string."""
    import ast

    name, _, value = text.partition('=')
    try:
        return name, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return name, value


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--case')
    parser.add_argument('--form', default='contact')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--options', nargs='*', type=option, default=[])
    parser.add_argument('--limit', type=float, default=180)
    parser.add_argument('--tee', action='store_true')
    chosen = parser.parse_args()
    p = module(chosen.case)
    if chosen.form == 'nosnoc':
        row = with_nosnoc(p, chosen.seed)
        del row['u']
        print(json.dumps(row, default=float))
        return
    row = with_pyomo_fesd(p, chosen.form, chosen.seed, dict(chosen.options), chosen.limit, chosen.tee)
    print(json.dumps(row, default=float))


if __name__ == '__main__':
    main()
