"""Some random switching systems of the study: answers are right, against event-located scipy."""

import pytest
from benchmarks.random_systems.generate import KINDS, draw
from benchmarks.random_systems.judge import ALARM, RIGHT, run


@pytest.mark.parametrize('seed', [0, 1])
@pytest.mark.parametrize('kind', [kind for kind in KINDS if kind != 'units'])
def test_simulate_is_right(kind, seed):
    system, found = draw(kind, seed)
    verdict, error, said = run(system, found, 'simulate', limit=60)
    assert verdict in (RIGHT, ALARM), (error, said)


@pytest.mark.parametrize('method', ['simulate', 'mpec_hybrid'])
@pytest.mark.parametrize('kind, seed', [('start on the surface', 2), ('repelling', 0), ('units', 14)])
def test_constants_that_cancel_hide_no_solution(kind, seed, method):
    """A start on a surface up to round-off, and states of 1e-7 near one."""
    system, found = draw(kind, seed)
    verdict, error, said = run(system, found, method, limit=60)
    assert verdict == RIGHT, (error, said)


@pytest.mark.parametrize('seed', [8, 21, 91])
def test_a_slide_in_large_units_gives_no_false_alarm_where_elements_march(seed):
    system, found = draw('units', seed)
    verdict, error, said = run(system, found, 'simulate, no grid', limit=60)
    assert verdict == RIGHT, (error, said)
