"""Rows that grow, child processes, and fits: the helpers that the studies share."""

import os
import time

import numpy as np
import pytest
from benchmarks.common.exact import error_of_times, thermostat_temperature
from benchmarks.common.fits import exponent
from benchmarks.common.processes import Child, NoAnswer, json_lines
from benchmarks.common.rows import Rows

KEY, COLUMNS = ('name', 'size', 'tolerance'), ('name', 'size', 'tolerance', 'error', 'status')


def test_a_run_with_a_row_is_known_also_to_the_next_process(tmp_path):
    rows = Rows(tmp_path / 'rows.csv', KEY, COLUMNS, digits=3)
    rows.add({'name': 'tank', 'size': 10, 'tolerance': 1e-7, 'error': 1.23456e-9})
    rows.add({'name': 'tank', 'size': 20, 'tolerance': 0.0, 'error': float('nan'), 'status': 'ok, late'})
    again = Rows(tmp_path / 'rows.csv', KEY, COLUMNS)
    for known in (rows, again):
        assert ('tank', 10, 1e-7) in known and ('tank', 20, 0) in known and ('tank', 30, 0.0) not in known
    assert rows.path.read_text() == 'name,size,tolerance,error,status\ntank,10,1e-07,1.23e-09,\ntank,20,0.0,,"ok, late"\n'


def test_fresh_rows_forget_the_file_and_unknown_columns_are_an_error(tmp_path):
    Rows(tmp_path / 'rows.csv', ('name',), ('name',)).add({'name': 'tank'})
    rows = Rows(tmp_path / 'rows.csv', ('name',), ('name',), fresh=True)
    assert ('tank',) not in rows
    with pytest.raises(ValueError, match="rows.csv has no column error"):
        rows.add({'name': 'tank', 'error': 1.0})


def double(pipe, offset):
    """Answer numbers; die of 'die', hang at 'hang'."""
    pipe.send('ready')
    while True:
        message = pipe.recv()
        if message == 'die':
            os._exit(1)
        if message == 'hang':
            time.sleep(60)
        pipe.send(2 * message + offset)


@pytest.mark.parametrize('message, reason', [('die', 'the process died'), ('hang', 'stopped after 0.2 s')])
def test_a_child_is_replaced_after_a_failure(message, reason):
    child = Child(double, 1, method='fork')
    child.send(3)
    assert child.receive(30) == 7
    child.send(message)
    with pytest.raises(NoAnswer, match=reason):
        child.receive(30 if message == 'die' else 0.2)
    child.send(4)
    assert child.receive(30) == 9
    child.stop()


SCRIPT = """
import sys, time
print('noise')
print('{"a": 1}', flush=True)
if sys.argv[1] == 'fail': raise SystemExit('no licence')
if sys.argv[1] == 'hang': time.sleep(60)
"""


@pytest.mark.parametrize('word, status, limit', [('end', 'ok', 60), ('fail', 'no licence', 60), ('hang', 'more than 5 s', 5)])
def test_rows_of_a_script_survive_its_end(tmp_path, word, status, limit):
    script = tmp_path / 'script.py'
    script.write_text(SCRIPT)
    assert json_lines(script, word, limit=limit) == ([{'a': 1}], status)


def test_errors_of_switching_times():
    assert error_of_times([2.0, 1.0], [1.0, 2.5]) == 0.5
    assert error_of_times([], []) == 0
    assert error_of_times([1.0], []) == np.inf


def test_the_thermostat_heats_and_cools():
    assert thermostat_temperature(0) == 15
    assert thermostat_temperature(0.5) == pytest.approx(50 - 35 * np.exp(-0.1))
    assert 18 < thermostat_temperature(1.0) < 20


def test_exponent():
    assert exponent([1, 2, 4], [3, 12, 48]) == pytest.approx(2)
