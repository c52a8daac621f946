"""Dynamic models from idaes-pse's own tests and examples with a switch added: errors, seconds of each phase, warnings.

    python docs/benchmarks/idaes/run.py [--fresh] [--only chemakzo]

Each model is built by the script as published, with ``casadi_ipopt.stand_in``.  The reference (folder ``reference``) integrates the
equations of one time with located events.  Writes rows.csv.  Needs the extra [idaes].
"""

import argparse
import contextlib
import inspect
import io
import json
import logging
import sys
import warnings
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).parents[2]))

import pyomo.environ as pyo
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows
from benchmarks.idaes.cases import CASES
from benchmarks.idaes.reference import Equations, integrate
from scipy.optimize import brentq

import pyomo_fesd

HERE = Path(__file__).parent
NCP, LIMIT = 3, 1800
#: Where the reference looks for a free value, relative to the published one.
SHOT = 0.7, 1.6
COLUMNS = (
    *('model', 'elements', 'lines', 'switches', 'of reference', 'first switch', 'reference', 'largest difference', 'end state'),
    *('stationarity', 'build (s)', 'transform (s)', 'simulate (s)', 'solve (s)', 'warnings', 'status', 'messages'),
)


class Messages(logging.Handler):
    """The warnings of the package."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.texts = []

    def emit(self, record):
        self.texts.append(' '.join(record.getMessage().split()))


def built(case, nfe):
    """The published model; initialisers that name Ipopt's executable use casadi's."""
    with pyomo_fesd.casadi_ipopt.stand_in(), contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter('ignore')  # marks of IDAES' own tests
        return case.build(nfe)


class Run:
    """One model with one number of elements, phase by phase; the row is filled on the way."""

    def __init__(self, name, nfe):
        self.case, self.nfe, self.row = CASES[name], nfe, {'model': name, 'elements': nfe}
        added = [f for f in (self.case.inputs, self.case.switch, self.case.freed) if f]
        self.row['lines'] = sum(len(inspect.getsource(f).strip().splitlines()) - 1 for f in added)

    def measure(self):
        """The row; a phase that fails ends it, with its reason."""
        messages = Messages()
        logging.getLogger('pyomo_fesd').addHandler(messages)
        try:
            for phase in ('build', 'transform', 'simulate', 'solve', 'compare'):
                clock = process_time()
                getattr(self, phase)()
                if phase != 'compare':
                    self.row[f'{phase} (s)'] = round(process_time() - clock, 2)
        except Exception as error:  # the row says what a user would see
            self.row['status'] = f'{phase}: {type(error).__name__}: {" ".join(str(error).split())}'[:400]
        return self.row | {'warnings': len(messages.texts), 'messages': ' | '.join(t[:160] for t in messages.texts[:4])}

    def build(self):
        self.m = built(self.case, self.nfe)
        self.published = self.m.clone()

    def transform(self):
        m, wrt = self.m, self.case.wrt(self.m)
        if self.case.inputs:
            self.case.inputs(m)
        if 'BACKWARD' in wrt.get_discretization_info()['scheme']:
            pyomo_fesd.recollocate(m, wrt, ncp=NCP)
        self.case.switch(m)
        pyo.TransformationFactory('fesd.dcs').apply_to(m, wrt=wrt)
        options = {'stages': list(self.case.stages)} if self.case.stages else {}
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=wrt, **options)

    def simulate(self):
        pyomo_fesd.simulate(self.m, self.case.wrt(self.m))

    def solve(self):
        if self.case.freed:
            self.case.freed(self.m)
        solver = pyo.SolverFactory('mpec_hybrid')
        results = solver.solve(self.m, warm_start=True)
        self.row |= {
            'stationarity': results.solver.stationarity,
            'status': str(results.solver.termination_condition),
        }

    def compare(self):
        """Switches and the end state beside the reference."""
        found = switching_times(self.case, self.m)
        self.row |= {'switches': len(found), 'first switch': found[0] if found else None}
        exact = reference(self.case, self.published, values_at_first(self.m))
        times = [s[0] for s in exact.switches]
        self.row |= {'of reference': len(times), 'reference': times[0] if times else None}
        if len(times) == len(found):
            self.row['largest difference'] = float(f'{max((abs(a - b) for a, b in zip(found, times)), default=0):.2g}')
        self.row['end state'] = float(f'{end_error(self.m, exact):.2g}')


def switching_times(case, m):
    """Times of the switches, in order."""
    wrt = case.wrt(m)
    if case.mode is None:
        return [s.time for s in pyomo_fesd.switches(m, wrt)]
    times, labels, ends = pyomo_fesd.physical_time(m, wrt), list(wrt), wrt.get_finite_elements()
    inside = [labels[labels.index(left) + 1] for left in ends[:-1]]
    modes = [case.mode(m, t) for t in inside]
    return [times[left] for left, a, b in zip(ends[1:], modes, modes[1:]) if a != b]


def values_at_first(m):
    """Values by name: those of the first time are the start of the reference."""
    return {v.name: v.value for v in m.component_data_objects(pyo.Var)}


def reference(case, m, start):
    """The Path of a published model with the switch."""
    if case.inputs:
        case.inputs(m)
    (case.exact or case.switch)(m)
    wrt = case.wrt(m)
    ends = [*case.stages, wrt.last()]

    def path():
        return integrate([(end, Equations(m, wrt, end, start)) for end in ends], **case.reference)

    if case.shot:
        free, state, wanted = case.shot(m)

        def miss(number):
            free.set_value(number)
            return path().end[state] - wanted

        free.set_value(brentq(miss, *(part * free.value for part in SHOT), rtol=1e-9))
    return path()


def end_error(m, exact):
    """The largest error of a state at the end, relative to its own largest magnitude on the way.

    States of the size of round-off beside the others of their Var have no digits.
    """
    values = {v.name: v.value for v in m.component_data_objects(pyo.Var)}
    family = {name: name.partition('[')[0] for name in exact.end}
    largest = {}
    for name, size in exact.scale.items():
        largest[family[name]] = max(largest.get(family[name], 0), size)
    errors = [abs(values[n] - x) / max(exact.scale[n], 1e-6 * largest[family[n]], 1e-12) for n, x in exact.end.items()]
    return max(errors, default=0.0)


def main():
    """Measure the missing rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', help="one model")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--measure', nargs=2, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.measure:
        print(json.dumps(Run(chosen.measure[0], int(chosen.measure[1])).measure()))
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
