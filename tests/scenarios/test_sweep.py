"""Sweeps: here, by executors, after a kill, with scenarios that fail."""

import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pandas as pd
import pyomo.environ as pyo
import pytest
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError, sweep

TABLE = pd.DataFrame({'a': [2.0, -1.0, 0.5, 3.0], 'b': [1.0, -1.0, 0.25, 0.5]}, index=list('wxyz'))
X = [2.0, 0.0, 0.5, 3.0]


def build(a, b, log=None):
    """min (x - a)^2 + (y - b)^2, 0 <= x perp y >= 0, for a > b: x = max(a, 0)."""
    if log is not None:
        with Path(log).open('a') as file:
            file.write('.')
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(bounds=(0, None), initialize=0.5), pyo.Var(bounds=(0, None), initialize=0.5)
    m.c = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.o = pyo.Objective(expr=(m.x - a) ** 2 + (m.y - b) ** 2)
    if a > 100:
        raise ValueError("a plant of\nthis size does not exist")
    if a > 50:
        m.never = pyo.Constraint(expr=m.x + m.y <= -1)
    return m


def twice(m):
    """An output that is computed."""
    return 2 * m.x.value


@pytest.mark.parametrize('executor', [None, ThreadPoolExecutor(1)])
def test_rows_in_rows_out(executor):
    found = sweep(build, TABLE, {'x': 'x', 'twice': twice}, executor=executor, progress=False)
    assert found.index.tolist() == list('wxyz')
    of_run = ['outcome', 'certified', 'objective', 'seconds', 'reason', 'warnings']
    assert found.columns.tolist() == ['a', 'b', *of_run, 'x', 'twice']
    assert found['x'].tolist() == pytest.approx(X, abs=1e-6) and found['twice'].tolist() == pytest.approx(
        [2 * x for x in X], abs=1e-6
    )
    assert found['certified'].all() and (found['outcome'] == 'optimal').all()
    assert found['objective'].tolist() == pytest.approx([1.0, 2.0, 0.0625, 0.25], abs=1e-6)


def test_a_failed_scenario_is_a_row_with_its_reason():
    table = pd.DataFrame({'a': [2.0, 1000.0, 60.0], 'b': [1.0, 1.0, 1.0]})
    found = sweep(build, table, ['x'], progress=False)
    assert found['outcome'].tolist()[:2] == ['optimal', 'failed']
    assert found['reason'][1] == 'ValueError: a plant of this size does not exist'
    assert found['outcome'][2] == 'infeasible' and found['reason'][2]
    assert found['certified'].tolist() == [True, False, False] and found['x'].isna().tolist() == [False, True, True]


def test_another_way_to_solve():
    found = sweep(build, TABLE, ['x'], solve=lambda m: m.x.set_value(7.0), progress=False)
    assert found['x'].tolist() == [7.0] * 4 and (found['outcome'] == 'solved').all() and not found['certified'].any()


def test_goes_on_with_the_rows_of_the_file(tmp_path):
    path, log = tmp_path / 'rows.csv', tmp_path / 'log'
    table = TABLE.assign(log=str(log))
    first = sweep(build, table, ['x'], path=path, progress=False)
    assert len(log.read_text()) == 4
    # the kill came while the last row was written
    path.write_bytes(path.read_bytes()[:-9])
    again = sweep(build, table, ['x'], path=path, progress=False)
    assert len(log.read_text()) == 5
    pd.testing.assert_frame_equal(again.drop(columns='seconds'), first.drop(columns='seconds'))
    assert path.read_text().count('\n') == 5


def test_refuses_a_file_of_another_sweep(tmp_path):
    path = tmp_path / 'rows.csv'
    sweep(build, TABLE[:1], ['x'], path=path, progress=False)
    with pytest.raises(FesdError, match='other values'):
        sweep(build, TABLE[1:], ['x'], path=path, progress=False)
    with pytest.raises(FesdError, match='its columns are'):
        sweep(build, TABLE, ['y'], path=path, progress=False)
    assert path.read_text().count('\n') == 2


def test_refuses_ambiguous_columns_and_unknown_options():
    with pytest.raises(FesdError, match='occur twice'):
        sweep(build, TABLE, ['a'], progress=False)
    with pytest.raises(FesdError, match='no keyword'):
        sweep(build, TABLE, ['x'], no_such_option=1, progress=False)


class Breaking:
    """An executor that loses every second scenario."""

    def __init__(self):
        self.number = 0

    def submit(self, run, values):
        """Run here, or lose the scenario."""
        self.number += 1
        future = Future()
        future.set_exception(RuntimeError("a worker died")) if self.number % 2 else future.set_result(run(values))
        return future


def test_scenarios_that_the_executor_loses_are_tried_again(tmp_path):
    path = tmp_path / 'rows.csv'
    found = sweep(build, TABLE, ['x'], executor=Breaking(), path=path, progress=False)
    assert found['outcome'].tolist() == ['not run', 'optimal'] * 2 and found['reason'].iloc[0] == 'RuntimeError: a worker died'
    found = sweep(build, TABLE, ['x'], path=path, progress=False)
    assert (found['outcome'] == 'optimal').all() and found['x'].tolist() == pytest.approx(X, abs=1e-6)


LONG = pd.DataFrame({'a': [2.0 + k for k in range(30)], 'b': 1.0})
KILLED = """
import pyomo_fesd
from tests.scenarios.test_sweep import LONG, build
pyomo_fesd.sweep(build, LONG, ['x'], path=PATH, progress=False)
"""


def test_nothing_is_lost_after_a_kill(tmp_path):
    path = tmp_path / 'rows.csv'
    process = subprocess.Popen([sys.executable, '-c', KILLED.replace('PATH', repr(str(path)))], cwd=Path(__file__).parents[2])
    try:
        until = time.monotonic() + 120
        while time.monotonic() < until and process.poll() is None and not (path.exists() and path.read_text().count('\n') > 3):
            time.sleep(0.05)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    before = path.read_text()[: path.read_text().rfind('\n') + 1]
    assert 3 < before.count('\n') <= len(LONG)
    found = sweep(build, LONG, ['x'], path=path, progress=False)
    assert path.read_text().startswith(before)
    assert found['x'].tolist() == pytest.approx(LONG['a'].tolist(), abs=1e-6)


def test_progress_bar_of_tqdm(monkeypatch):
    seen = []

    class Bar:
        def __init__(self, **kwds):
            seen.append(kwds)

        def update(self):
            seen.append('update')

        def close(self):
            seen.append('close')

    module = type(sys)('tqdm.auto')
    module.tqdm = Bar
    monkeypatch.setitem(sys.modules, 'tqdm', type(sys)('tqdm'))
    monkeypatch.setitem(sys.modules, 'tqdm.auto', module)
    sweep(build, TABLE[:2], ['x'])
    assert seen == [{'total': 2, 'initial': 0, 'unit': 'scenario'}, 'update', 'update', 'close']
    monkeypatch.setitem(sys.modules, 'tqdm.auto', None)
    assert len(pyomo_fesd.sweep(build, TABLE[:2], ['x'])) == 2
