"""The gas-liquid tank with pyomo_fesd and with nosnoc, in the same run: time of each phase, error, work.

    .venv/bin/pip install nosnoc==0.2.0
    .venv/bin/python docs/benchmarks/tank/run.py

Writes rows.csv beside this file.  Times are medians of several runs on the machine at hand: compare the ratios.
"""

import statistics
import sys
import time
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import gas_liquid_tank
import pandas as pd
import pyomo.environ as pyo
from benchmarks.tank.nosnoc_peer import solve_tank_with_nosnoc
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.factory import SolverFactory

import pyomo_fesd

HERE = Path(__file__).parent
REPEATS = 5
#: (scheme, K) of both tools
SCHEMES = (('LAGRANGE-RADAU', 3), ('LAGRANGE-LEGENDRE', 2))
NUMBERS = (25, 50, 100)
#: nosnoc's default, and a tolerance at which the grid limits its accuracy
NOSNOC_TOLERANCES = (None, 1e-12)
TIMES = ('build', 'transform', 'compile', 'NLPs', 'LPECs', 'total')
EXACT = gas_liquid_tank.EXACT


def discretised(N, K, scheme):
    """The model after both transformations, and the clock at the end of each phase."""
    clock = [time.perf_counter()]
    m = gas_liquid_tank.build()
    clock.append(time.perf_counter())
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=N, ncp=K, scheme=scheme)
    clock.append(time.perf_counter())
    return m, clock


def with_mpec_hybrid(N, K, scheme, **options):
    """One run of pyomo_fesd with ``mpec_hybrid``; times by phase, all of them in ``total``."""
    m, clock = discretised(N, K, scheme)
    timer = HierarchicalTimer()
    results = SolverFactory('mpec_hybrid').solve(m, timer=timer, **options)
    clock.append(time.perf_counter())
    return times_and_errors(m, clock) | {
        'compile': seconds(timer, 'compile', 'build'),
        'NLPs': seconds(timer, 'relaxation', 'branch'),
        'LPECs': seconds(timer, 'lpec'),
        'nlps': results.extra_info.nlps,
        'iterations': results.extra_info.nlp_iterations,
        'status': results.extra_info.stationarity,
    }


def seconds(timer, *phases):
    """Time of some phases; 0 for those that were not needed."""
    return sum(timer.get_total_time(phase) for phase in phases if phase in timer.timers)


def with_simulate(N, K, scheme):
    """One run of ``simulate`` alone, for which the elements need not be laid; the tank has zero degrees of freedom."""
    clock = [time.perf_counter()]
    m = gas_liquid_tank.build()
    clock += 2 * [time.perf_counter()]
    frame = pyomo_fesd.simulate(m, nfe=N, ncp=K, scheme=scheme)
    clock.append(time.perf_counter())
    return times_and_errors(m, clock, frame) | {'status': 'simulated'}


def times_and_errors(m, clock, frame=None):
    """Times and errors of a solved model, or of one that was simulated without elements, with its trajectory ``frame``."""
    (switch,) = pyomo_fesd.switches(m if frame is None else frame)
    return {
        'build': clock[1] - clock[0],
        'transform': clock[2] - clock[1],
        'total': clock[3] - clock[0],
        'error t_s': abs(switch.time - EXACT['t_s']),
        'relative error M_G': abs(m.M_G[m.t.last()].value / EXACT['M_G'] - 1),
    }


def with_nosnoc(N, K, scheme, tolerance):
    """One run of nosnoc."""
    run = solve_tank_with_nosnoc(N, K, scheme, tolerance)
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


def tools(N, K, scheme):
    """``{name: function}`` of all tools for one grid."""
    result = {
        'pyomo_fesd': partial(with_mpec_hybrid, N, K, scheme, simulate_first=False),
        'pyomo_fesd, defaults': partial(with_mpec_hybrid, N, K, scheme),
        'pyomo_fesd, simulate': partial(with_simulate, N, K, scheme),
    }
    for tolerance in NOSNOC_TOLERANCES:
        name = 'nosnoc 0.2.0' + ('' if tolerance is None else f', comp_tol={tolerance:g}')
        result[name] = partial(with_nosnoc, N, K, scheme, tolerance)
    return result


def median(runs):
    """Medians of the times; the other columns of the last run."""
    return runs[-1] | {name: statistics.median(r[name] for r in runs) for name in TIMES if name in runs[-1]}


def measure():
    """One row for each tool, scheme and N."""
    rows = []
    for scheme, K in SCHEMES:
        for N in NUMBERS:
            for tool, run in tools(N, K, scheme).items():
                rows.append({'tool': tool, 'scheme': scheme, 'K': K, 'N': N} | median([run() for _ in range(REPEATS)]))
                print(rows[-1], flush=True)
    return pd.DataFrame(rows)


def main():
    """Measure and write the table; print the ratios to nosnoc at its default."""
    table = measure()
    table.to_csv(HERE / 'rows.csv', index=False, float_format='%.4g')
    wide = table.pivot(index=['scheme', 'K', 'N'], columns='tool', values=['total', 'error t_s'])
    for quantity in ('total', 'error t_s'):
        for tool in ('pyomo_fesd', 'pyomo_fesd, defaults', 'pyomo_fesd, simulate'):
            ratio = wide[quantity][tool] / wide[quantity]['nosnoc 0.2.0']
            print(f"\n{quantity}: {tool} / nosnoc\n{ratio.to_string()}")


if __name__ == '__main__':
    main()
