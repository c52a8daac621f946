"""Dynamic models from idaes-pse's own tests and examples with a switch added: switching times, and seconds of each phase.

    python docs/benchmarks/idaes/run.py [--fresh] [--only chemakzo]

Each model is built by the script as published, with ``casadi_ipopt.stand_in``, on its own elements and on twice as many.  The
reference is the model without the switch on a fixed fine grid, up to the first zero of the guard.  Writes rows.csv.  Needs the
extra [idaes].
"""

import argparse
import contextlib
import inspect
import io
import json
import logging
import sys
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).parents[2]))

import pyomo.environ as pyo
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from benchmarks.idaes.cases import CASES
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import brentq

import pyomo_fesd

HERE = Path(__file__).parent
NCP, LIMIT = 3, 900
COLUMNS = (
    *('model', 'elements', 'lines', 'switch', 'reference', 'difference', 'stationarity', 'NLPs'),
    *('build (s)', 'transform (s)', 'simulate (s)', 'solve (s)', 'warnings', 'status'),
)


class Messages(logging.Handler):
    """Counts the warnings of the package by their first word."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.texts = []

    def emit(self, record):
        self.texts.append(record.getMessage())


def built(case, nfe):
    """The published model; initialisers that name Ipopt's executable use casadi's."""
    with pyomo_fesd.casadi_ipopt.stand_in(), contextlib.redirect_stdout(io.StringIO()):
        return case.build(nfe)


def more_points(m, wrt):
    """BACKWARD differences become Radau with NCP points."""
    if 'BACKWARD' in wrt.get_discretization_info()['scheme']:
        pyomo_fesd.recollocate(m, wrt, ncp=NCP)


def measure(name, nfe):
    """One row."""
    case, row, clock = CASES[name], {'model': name, 'elements': nfe}, process_time()
    messages = Messages()
    logging.getLogger('pyomo_fesd').addHandler(messages)

    def done(phase):
        nonlocal clock
        row[f'{phase} (s)'] = round(process_time() - clock, 2)
        clock = process_time()

    m = built(case, nfe)
    done('build')
    case.switch(m)
    wrt = case.wrt(m)
    more_points(m, wrt)
    pyo.TransformationFactory('fesd.dcs').apply_to(m, wrt=wrt)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=wrt)
    done('transform')
    pyomo_fesd.simulate(m, wrt)
    done('simulate')
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    done('solve')
    found = pyomo_fesd.switches(m, wrt)
    exact = reference(case)
    first = found[0].time if found else None
    return row | {
        'lines': len(inspect.getsource(case.switch).strip().splitlines()) - 1,
        'switch': None if first is None else round(first, 7),
        'reference': None if exact is None else round(exact, 7),
        'difference': None if None in (first, exact) else float(f'{abs(first - exact):.1e}'),
        'stationarity': results.solver.stationarity,
        'NLPs': results.solver.nlps,
        'warnings': len(messages.texts),
        'status': str(results.solver.termination_condition),
    }


def reference(case):
    """The first zero of the guard of the model without the switch, by the polynomials of a fixed fine grid."""
    m = built(case, case.fine)
    wrt = case.wrt(m)
    more_points(m, wrt)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=wrt)
    pyomo_fesd.simulate(m, wrt)
    pyo.assert_optimal_termination(pyo.SolverFactory('casadi_ipopt').solve(m))
    labels, boundaries = list(wrt), wrt.get_finite_elements()
    guard = {t: pyo.value(case.guard(m, t)) for t in labels}
    for left, right in zip(boundaries, boundaries[1:]):
        if guard[left] * guard[right] < 0:
            inside = [t for t in labels if left <= t <= right]
            return brentq(BarycentricInterpolator(inside, [guard[t] for t in inside]), left, right, xtol=1e-13)
    return None


def main():
    """Measure the missing rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', help="one model")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--measure', nargs=2, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.measure:
        print(json.dumps(measure(chosen.measure[0], int(chosen.measure[1]))))
        return
    rows = Rows(HERE / 'rows.csv', ('model', 'elements'), COLUMNS, fresh=chosen.fresh, digits=9)
    for name in CASES if chosen.only is None else (chosen.only,):
        for nfe in CASES[name].grids:
            if (name, nfe) not in rows:
                found, status = json_lines(__file__, '--measure', name, nfe, limit=LIMIT)
                row = found[-1] if found else {'model': name, 'elements': nfe, 'status': status}
                print(row, flush=True)
                rows.add(row)


if __name__ == '__main__':
    main()
