"""IDAES' own tests of initialisation, as installed, with casadi's Ipopt in place of the executable that they name.

    python docs/benchmarks/idaes/initialisation.py [--fresh] [--only test_cstr]

Runs the tests whose names contain ``initialize``, file by file, within ``pyomo_fesd.casadi_ipopt.stand_in``, and writes the outcome
of each to initialisation.csv.  Tests of models that need IDAES' compiled functions are skipped by IDAES itself, or fail and are
listed.  Needs the extra [idaes].
"""

import argparse
import contextlib
import io
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import pytest
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows

HERE, LIMIT = Path(__file__).parent, 240
UNITS, CONTACTORS = 'idaes.models.unit_models.tests.', 'idaes.models_extra.gas_solid_contactors.unit_models.tests.'
#: Modules of tests, by the model that they initialise.
FILES = {
    'CSTR': UNITS + 'test_cstr',
    'plug flow reactor': UNITS + 'test_pfr',
    'heater': UNITS + 'test_heater',
    'mixer': UNITS + 'test_mixer',
    'separator': UNITS + 'test_separator',
    'flash': UNITS + 'test_flash',
    'valve': UNITS + 'test_valve',
    'pressure changer': UNITS + 'test_pressure_changer',
    'stoichiometric reactor': UNITS + 'test_rstoic',
    'equilibrium reactor': UNITS + 'test_equilibrium_reactor',
    'heat exchanger': UNITS + 'test_heat_exchanger',
    'heat exchanger with NTU': UNITS + 'test_hx_ntu',
    'lumped heat exchanger': UNITS + 'test_heat_exchanger_lc',
    'CSTR with PID': 'idaes.core.util.tests.test_pid_initialization',
    'fixed bed 0D': CONTACTORS + 'test_FB0D',
    'fixed bed 1D': CONTACTORS + 'test_FB1D',
}
COLUMNS = ('model', 'test', 'outcome', 'seconds', 'reason')


class Outcomes:
    """A plug-in of pytest that collects what became of each test."""

    def __init__(self):
        self.rows = []

    def pytest_runtest_logreport(self, report):
        if report.when == 'call' or report.outcome != 'passed':
            self.rows.append(
                {
                    'test': report.nodeid.partition('::')[2],
                    'outcome': report.outcome,
                    'seconds': round(report.duration, 2),
                    'reason': '' if report.outcome == 'passed' else _reason(report),
                }
            )


def _reason(report):
    if isinstance(report.longrepr, tuple):
        return report.longrepr[-1][:120]
    return getattr(getattr(report.longrepr, 'reprcrash', None), 'message', str(report.longrepr)).splitlines()[0][:120]


def run(module):
    """Outcomes of the tests of a module."""
    import pyomo_fesd

    outcomes = Outcomes()
    options = ['-q', '-p', 'no:cacheprovider', '-W', 'ignore', '--rootdir', str(HERE), '-c', '/dev/null', '-k', 'initialize']
    with pyomo_fesd.casadi_ipopt.stand_in(), contextlib.redirect_stdout(io.StringIO()):
        pytest.main([*options, '--pyargs', module], plugins=[outcomes])
    return outcomes.rows


def main():
    """Run the modules that have no rows yet."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', help="a model")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--run', help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.run:
        for row in run(FILES[chosen.run]):
            print(json.dumps(row))
        return
    path = HERE / 'initialisation.csv'
    known = path.read_text() if path.exists() and not chosen.fresh else ''
    rows = Rows(path, ('model', 'test'), COLUMNS, fresh=chosen.fresh)
    for model in FILES if chosen.only is None else (chosen.only,):
        if f'\n{model},' in known:
            continue
        found, status = json_lines(__file__, '--run', model, limit=LIMIT)
        for row in found or [{'test': '', 'outcome': 'stopped', 'reason': status}]:
            rows.add({'model': model} | row)
        print(model, [row['outcome'] for row in found], status, flush=True)


if __name__ == '__main__':
    main()
