"""Disjunctions without time: as an MPCC by ``mpec_hybrid``, beside Pyomo's gdp.bigm and gdp.hull with HiGHS, and GDPopt.

    python docs/benchmarks/gdp/run.py [--fresh] [--only 'eight processes']

Each problem runs in a process of its own with a time limit.  Writes rows.csv and summary.csv beside this file; problems that have
rows are skipped.  The reference is the best objective that any method found: with HiGHS the global optimum where all is linear, and
with the enumeration of all choices (gdpopt.enumerate) where each choice is convex.
"""

import argparse
import json
import sys
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).parents[2]))

import pandas as pd
import pyomo.environ as pyo
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from benchmarks.gdp.problems import PROBLEMS, three_jobs
from benchmarks.gdp.vanishing import as_mpcc
from pyomo.gdp import Disjunct, Disjunction

import pyomo_fesd

PLACES = (pyo.Block, Disjunct)
HERE, CLOSE, NONE = Path(__file__).parent, 1e-4, 'no answer'
#: Limits of wall time: of one method, of all methods for one problem.
SECONDS, LIMIT = 60, 600
COLUMNS = ('problem', 'class', 'method', 'objective', 'reference', 'violation', 'pairs', 'status', 'verdict', 'seconds')


@pyo.SolverFactory.register('highs_for_gdpopt')
class Highs:
    """HiGHS that returns 'infeasible', which ends an outer approximation, where Pyomo's interfaces raise."""

    options = {}

    def available(self):
        return True

    def solve(self, model, **_):
        highs = pyo.SolverFactory('appsi_highs')
        results = highs.solve(model, load_solutions=False)
        if results.solver.termination_condition == pyo.TerminationCondition.optimal:
            highs.load_vars()
        return results


def by_pairs(**options):
    """Solve by vanishing pairs; returns (objective, violation, pairs, status)."""

    def solve(m):
        mpcc = as_mpcc(m)
        results = pyo.SolverFactory('mpec_hybrid').solve(mpcc, time_limit=SECONDS, **options)
        pairs = pyomo_fesd.report(mpcc)['pairs']
        violated = violation(m, mpcc)
        if results.solver.stationarity != 'B' and violated > CLOSE:
            return None, None, pairs, f'{results.solver.termination_condition}, no point'
        return pyo.value(_objective(mpcc)), violated, pairs, f"{results.solver.stationarity}-stationary, local"

    return solve


def by_highs(transformation):
    """Solve a linear problem by HiGHS after a transformation of pyomo.gdp."""

    def solve(m):
        pyo.TransformationFactory('core.logical_to_linear').apply_to(m)
        pyo.TransformationFactory(transformation).apply_to(m, **({'bigM': 1000} if transformation == 'gdp.bigm' else {}))
        results = pyo.SolverFactory('appsi_highs').solve(m)
        return pyo.value(_objective(m)), None, 0, f'{results.solver.termination_condition}, global'

    return solve


def by_gdpopt(algorithm, verdict):
    """Solve by GDPopt with HiGHS for its linear problems and casadi's Ipopt for its NLPs."""

    def solve(m):
        options = {} if algorithm == 'enumerate' else {'mip_solver': 'highs_for_gdpopt', 'init_algorithm': 'set_covering'}
        results = pyo.SolverFactory(f'gdpopt.{algorithm}').solve(m, nlp_solver='casadi_ipopt', time_limit=SECONDS, **options)
        condition, violated = results.solver.termination_condition, max([0.0, *_violations(m, logic=True)])
        if violated > CLOSE:
            return None, None, 0, f'{condition}, no point'
        return pyo.value(_objective(m)), violated, 0, f'{condition}, {verdict}'

    return solve


#: Methods by name, with the classes of problems that they are for.
METHODS = {
    'bigm, HiGHS': (by_highs('gdp.bigm'), ('linear',)),
    'hull, HiGHS': (by_highs('gdp.hull'), ('linear',)),
    'enumeration': (by_gdpopt('enumerate', 'all choices'), ('convex', 'nonconvex')),
    'outer approximation': (by_gdpopt('loa', 'global if convex'), ('convex', 'nonconvex')),
    'pairs': (by_pairs(), ('linear', 'convex', 'nonconvex')),
    'pairs, full LPEC': (by_pairs(lpec='full'), ('linear', 'convex', 'nonconvex')),
    'pairs, 8 starts': (by_pairs(starts=8), ('linear', 'convex', 'nonconvex')),
}


def _objective(m):
    return next(m.component_data_objects(pyo.Objective, active=True))


def violation(m, solved):
    """The largest violation of a problem at the values of its MPCC; where logic counts, of the disjuncts that it chooses."""
    for v in m.component_data_objects(pyo.Var, descend_into=PLACES):
        if not v.fixed and not v.is_binary():
            v.set_value(solved.find_component(v).value, skip_validation=True)
    logic = any(True for _ in m.component_data_objects(pyo.LogicalConstraint, active=True, descend_into=PLACES))
    if logic:
        for y in m.component_data_objects(pyo.BooleanVar, descend_into=PLACES):
            binary = solved.find_component(y).get_associated_binary()
            y.set_value(binary is not None and binary.value > 0.5)
    return max([0.0, *_violations(m, logic)])


def _violations(block, logic):
    for c in block.component_data_objects(pyo.Constraint, active=True, descend_into=pyo.Block):
        yield max(-c.lslack() if c.has_lb() else 0.0, -c.uslack() if c.has_ub() else 0.0)
    for c in block.component_data_objects(pyo.LogicalConstraint, active=True, descend_into=pyo.Block):
        yield 0.0 if pyo.value(c.expr) else 1.0
    for d in block.component_data_objects(Disjunction, active=True, descend_into=pyo.Block):
        chosen = [disjunct for disjunct in d.disjuncts if disjunct.active and (not logic or disjunct.indicator_var.value)]
        yield min((max([0.0, *_violations(disjunct, logic)]) for disjunct in chosen), default=1.0)


def run(name):
    """Print one row for each method."""
    build, kind, unlike = PROBLEMS[name]
    by_pairs()(three_jobs())  # imports are not timed
    for method, (solve, kinds) in METHODS.items():
        if kind not in kinds:
            continue
        m, row = (build if method.startswith('pairs') else unlike or build)(), {'problem': name, 'class': kind, 'method': method}
        row['sign'], started = 1 if _objective(m).is_minimizing() else -1, process_time()
        try:
            row['objective'], row['violation'], row['pairs'], row['status'] = solve(m)
        except Exception as error:  # whatever a solver says of a problem is a row
            row['status'] = f'{type(error).__name__}: {str(error).strip().splitlines()[0][:100]}'
        row['seconds'] = round(process_time() - started, 2)
        print(json.dumps(row), flush=True)


def judged(found):
    """The rows of one problem with the reference, the best objective that any method found, and a verdict."""
    answers = [row for row in found if row.get('objective') is not None and (row['violation'] or 0.0) <= CLOSE]
    best = min((row['sign'] * row['objective'] for row in answers), default=None)
    for row in found:
        sign = row.pop('sign')
        row['reference'] = None if best is None else sign * best
        row['verdict'] = NONE if row.get('objective') is None else 'violated' if row not in answers else None
        if row['verdict'] is None:
            row['verdict'] = 'best' if sign * row['objective'] - best <= CLOSE * max(1.0, abs(best)) else 'worse'
        yield row


def summary(table):
    """Verdicts and CPU seconds by class and method."""
    counts = table.groupby(['class', 'method', 'verdict'], sort=False).size().unstack(fill_value=0)
    counts['seconds'] = table.groupby(['class', 'method'], sort=False)['seconds'].sum().round(1)
    return counts.reset_index()


def main():
    """Measure what has no rows, and count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', choices=PROBLEMS, help="a problem")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--run', help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.run:
        run(chosen.run)
        return
    rows = Rows(HERE / 'rows.csv', ('problem', 'method'), COLUMNS, fresh=chosen.fresh)
    for name in PROBLEMS if chosen.only is None else (chosen.only,):
        missing = [m for m, (_, kinds) in METHODS.items() if PROBLEMS[name][1] in kinds and (name, m) not in rows]
        if missing:
            found, status = json_lines(__file__, '--run', name, limit=LIMIT)
            for row in judged(found):
                rows.add(row)
            done = {row['method'] for row in found}
            for method in missing if status != 'ok' else ():
                if method not in done:
                    rows.add({'problem': name, 'class': PROBLEMS[name][1], 'method': method, 'status': status, 'verdict': NONE})
            print(name, [(row['method'], row['verdict']) for row in found], status, flush=True)
    summary(pd.read_csv(rows.path)).to_csv(HERE / 'summary.csv', index=False, lineterminator='\n')


if __name__ == '__main__':
    main()
