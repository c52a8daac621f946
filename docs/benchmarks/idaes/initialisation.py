"""IDAES' own tests that initialise and solve, as installed, with casadi's Ipopt in place of the executable that they name.

    python docs/benchmarks/idaes/initialisation.py [--fresh] [--only CSTR]

Runs the tests file by file within ``pyomo_fesd.casadi_ipopt.stand_in``, and writes the outcome of those whose names contain one of
``WORDS`` to initialisation.csv, and their counts by model to models.csv; the others run too, as some prepare the model.  Tests of
models that need IDAES' compiled functions are skipped by IDAES itself, or fail and are listed.  Seconds are CPU seconds.  Needs the
extra [idaes].
"""

import argparse
import contextlib
import io
import json
import sys
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).parents[2]))

import pandas as pd
import pytest
from benchmarks.common.processes import json_lines
from benchmarks.common.rows import Rows

HERE, LIMIT = Path(__file__).parent, 600
#: Parts of the names of the tests that are listed: those that initialise, and those that examine what was initialised.
WORDS = ('init', 'solve', 'solution', 'conservation')
UNITS, CONTACTORS = 'idaes.models.unit_models.tests.', 'idaes.models_extra.gas_solid_contactors.unit_models.tests.'
GAS, COLUMNS_OF_TRAYS = 'idaes.models_extra.gas_distribution.unit_models.tests.', 'idaes.models_extra.column_models.tests.'
#: Modules of tests, by the model that they initialise.
FILES = {
    'CSTR': UNITS + 'test_cstr',
    'plug flow reactor': UNITS + 'test_pfr',
    'heater': UNITS + 'test_heater',
    'mixer': UNITS + 'test_mixer',
    'feed': UNITS + 'test_feed',
    'feed with flash': UNITS + 'test_feed_flash',
    'product': UNITS + 'test_product',
    'state junction': UNITS + 'test_statejunction',
    'stream scaler': UNITS + 'test_stream_scaler',
    'translator': UNITS + 'test_translator',
    'skeleton unit': UNITS + 'test_skeleton_unit_model',
    'pipe': UNITS + 'test_pipe',
    'flash': UNITS + 'test_flash',
    'valve': UNITS + 'test_valve',
    'pressure changer': UNITS + 'test_pressure_changer',
    'stoichiometric reactor': UNITS + 'test_rstoic',
    'equilibrium reactor': UNITS + 'test_equilibrium_reactor',
    'Gibbs reactor': UNITS + 'test_gibbs',
    'contactor of streams': UNITS + 'test_mscontactor',
    'heat exchanger': UNITS + 'test_heat_exchanger',
    'heat exchanger with NTU': UNITS + 'test_hx_ntu',
    'lumped heat exchanger': UNITS + 'test_heat_exchanger_lc',
    'gas pipeline': GAS + 'test_pipeline',
    'gas pipeline and compressor': GAS + 'test_pipeline_compressor',
    'plate heat exchanger': COLUMNS_OF_TRAYS + 'test_plate_heat_exchanger',
    'condenser': COLUMNS_OF_TRAYS + 'test_total_condenser',
    'reboiler': COLUMNS_OF_TRAYS + 'test_reboiler',
    'column of trays': COLUMNS_OF_TRAYS + 'test_tray_column',
    'CSTR with PID': 'idaes.core.util.tests.test_pid_initialization',
    'CSTR of caprese': 'idaes.apps.caprese.tests.test_dynamic_block',
    'separator': UNITS + 'test_separator',
    'heat exchanger 1D': UNITS + 'test_heat_exchanger_1D',
    'shell and tube 1D': UNITS + 'test_shell_and_tube_1D',
    'fixed bed 0D': CONTACTORS + 'test_FB0D',
    'fixed bed 1D': CONTACTORS + 'test_FB1D',
    'moving bed': CONTACTORS + 'test_MB',
}
COLUMNS = ('model', 'test', 'outcome', 'seconds', 'reason')
SUMMARY = ('model', 'passed', 'without a compiled library', 'skipped for another reason', 'failed', 'stopped', 'seconds')
#: Parts of the messages of tests that need a compiled library: IDAES' functions, or PyNumero's for the DiagnosticsToolbox.
COMPILED = ('IAPWS', 'Helmholtz', 'external function', 'ExternalFunction', 'Cubic', 'Pynumero')


class Outcomes:
    """A plug-in of pytest that prints, as JSON, what became of each test as soon as it has ended."""

    def __init__(self, file):
        self.file, self.started = file, process_time()

    def pytest_runtest_logstart(self):
        self.started = process_time()

    def pytest_runtest_logreport(self, report):
        name = report.nodeid.partition('::')[2]
        listed = any(word in name.lower() for word in WORDS)
        if listed and (report.when == 'call' or report.outcome != 'passed'):
            row = {
                'test': name,
                'outcome': report.outcome,
                'seconds': round(process_time() - self.started, 2),
                'reason': '' if report.outcome == 'passed' else _reason(report),
            }
            print(json.dumps(row), file=self.file, flush=True)


def _reason(report):
    if isinstance(report.longrepr, tuple):
        return report.longrepr[-1][:120]
    return getattr(getattr(report.longrepr, 'reprcrash', None), 'message', str(report.longrepr)).splitlines()[0][:160]


def run(module):
    """Run the tests of a module, and print their outcomes."""
    import pyomo_fesd

    outcomes = Outcomes(sys.stdout)
    options = ['-q', '-p', 'no:cacheprovider', '-W', 'ignore', '--rootdir', str(HERE), '-c', '/dev/null']
    with pyomo_fesd.casadi_ipopt.stand_in(), contextlib.redirect_stdout(io.StringIO()):
        pytest.main([*options, '--pyargs', module], plugins=[outcomes])


def summary(table):
    """Counts of the outcomes by model."""
    compiled = table['reason'].fillna('').str.contains('|'.join(COMPILED), case=False)
    kind = table['outcome'].where(~compiled | (table['outcome'] == 'passed'), 'without a compiled library')
    kind = kind.replace('skipped', 'skipped for another reason')
    counts = table.groupby(['model', kind], sort=False).size().unstack(fill_value=0)
    counts['seconds'] = table.groupby('model', sort=False)['seconds'].sum().round(1)
    return counts.reset_index().reindex(columns=list(SUMMARY), fill_value=0)


def main():
    """Run the modules that have no rows yet, and count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', choices=FILES, help="a model")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--run', help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.run:
        run(FILES[chosen.run])
        return
    path = HERE / 'initialisation.csv'
    known = path.read_text() if path.exists() and not chosen.fresh else ''
    rows = Rows(path, ('model', 'test'), COLUMNS, fresh=chosen.fresh)
    for model in FILES if chosen.only is None else (chosen.only,):
        if f'\n{model},' in known:
            continue
        found, status = json_lines(__file__, '--run', model, limit=LIMIT)
        for row in found if status == 'ok' else [*found, {'test': '', 'outcome': 'stopped', 'reason': status}]:
            rows.add({'model': model} | row)
        print(model, [row['outcome'] for row in found], status, flush=True)
    summary(pd.read_csv(path)).to_csv(HERE / 'models.csv', index=False, lineterminator='\n')


if __name__ == '__main__':
    main()
