"""The gas-liquid tank with pyomo_fesd and with nosnoc, in the same run: time of each phase, error, work.

    pip install nosnoc==0.2.0
    python docs/benchmarks/tank.py

writes tank.csv beside this file.  Times are medians of several runs on the machine at hand: read the ratios.
"""

import statistics
import sys
import time
from functools import partial
from pathlib import Path

import pandas as pd
import pyomo.environ as pyo
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.factory import SolverFactory

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / 'examples')]

import gas_liquid_tank  # noqa: E402
from tank_nosnoc import solve_tank_with_nosnoc  # noqa: E402

import pyomo_fesd  # noqa: E402

REPEATS = 3
#: (scheme, K) of the two tools
SCHEMES = (('LAGRANGE-RADAU', 3), ('LAGRANGE-LEGENDRE', 2))
NUMBERS = (25, 50, 100)
#: nosnoc at its default and at a tolerance where it is limited by its grid
NOSNOC_TOLERANCES = (None, 1e-12)
EXACT = gas_liquid_tank.EXACT


def discretised(N, K, scheme):
    """The model after both transformations, and the times at which its phases ended."""
    clock = [time.perf_counter()]
    m = gas_liquid_tank.build()
    clock.append(time.perf_counter())
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=N, ncp=K, scheme=scheme)
    clock.append(time.perf_counter())
    return m, clock


def ours(N, K, scheme):
    """One run of pyomo_fesd with ``mpec_hybrid``; times by phase, all of them in ``total``."""
    m, clock = discretised(N, K, scheme)
    timer = HierarchicalTimer()
    results = SolverFactory('mpec_hybrid').solve(m, timer=timer)
    clock.append(time.perf_counter())
    return found(m, clock) | {
        'compile': timer.get_total_time('compile') + timer.get_total_time('build'),
        'NLPs': timer.get_total_time('relaxation') + timer.get_total_time('branch'),
        'LPECs': timer.get_total_time('lpec'),
        'nlps': results.extra_info.nlps,
        'iterations': results.extra_info.nlp_iterations,
        'status': results.extra_info.stationarity,
    }


def marched(N, K, scheme):
    """The same with ``simulate`` alone, which gives the same solution: the tank has no freedom."""
    m, clock = discretised(N, K, scheme)
    pyomo_fesd.simulate(m)
    clock.append(time.perf_counter())
    return found(m, clock) | {'status': 'simulated'}


def found(m, clock):
    """Times and errors of a solved model."""
    (switch,) = pyomo_fesd.switches(m)
    return {
        'build': clock[1] - clock[0],
        'transform': clock[2] - clock[1],
        'total': clock[3] - clock[0],
        'error t_s': abs(switch.time - EXACT['t_s']),
        'relative error M_G': abs(m.M_G[m.t.last()].value / EXACT['M_G'] - 1),
    }


def theirs(N, K, scheme, tolerance):
    """One run of nosnoc."""
    run = solve_tank_with_nosnoc(N, K, 'RADAU' if scheme.endswith('RADAU') else 'GAUSS', comp_tol=tolerance)
    return {
        'build': run['build'],
        'NLPs': run['solve'],
        'total': run['build'] + run['solve'],
        'nlps': run['nlps'],
        'iterations': run['iterations'],
        'error t_s': abs(run['t_s'] - EXACT['t_s']),
        'relative error M_G': abs(run['M_G_end'] / EXACT['M_G'] - 1),
        'status': run['status'],
    }


def median(runs):
    """Medians of the times, everything else from the last run."""
    timed = ('build', 'transform', 'compile', 'NLPs', 'LPECs', 'total')
    return runs[-1] | {name: statistics.median(r[name] for r in runs) for name in timed if name in runs[-1]}


def measure():
    """One row for each tool, scheme and N."""
    rows = []
    for scheme, K in SCHEMES:
        for N in NUMBERS:
            tools = {'pyomo_fesd': partial(ours, N, K, scheme), 'pyomo_fesd, simulate': partial(marched, N, K, scheme)}
            for tolerance in NOSNOC_TOLERANCES:
                name = 'nosnoc 0.2.0' + ('' if tolerance is None else f', comp_tol={tolerance:g}')
                tools[name] = partial(theirs, N, K, scheme, tolerance)
            for tool, run in tools.items():
                rows.append({'tool': tool, 'scheme': scheme, 'K': K, 'N': N} | median([run() for _ in range(REPEATS)]))
                print(rows[-1], flush=True)
    return pd.DataFrame(rows)


def main():
    """Measure and write the table; print the ratios to nosnoc at its default."""
    table = measure()
    table.to_csv(HERE / 'tank.csv', index=False, float_format='%.4g')
    wide = table.pivot(index=['scheme', 'K', 'N'], columns='tool', values=['total', 'error t_s'])
    for quantity in ('total', 'error t_s'):
        for tool in ('pyomo_fesd', 'pyomo_fesd, simulate'):
            ratio = wide[quantity][tool] / wide[quantity]['nosnoc 0.2.0']
            print(f"\n{quantity}: {tool} / nosnoc\n{ratio.to_string()}")


if __name__ == '__main__':
    main()
