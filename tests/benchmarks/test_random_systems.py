"""Some random switching systems of the study: simulate is right on each, against event-located scipy."""

import pytest
from benchmarks.random_systems.generate import KINDS, draw
from benchmarks.random_systems.judge import ALARM, RIGHT, run


@pytest.mark.parametrize('seed', [0, 1])
@pytest.mark.parametrize('kind', [kind for kind in KINDS if kind != 'units'])
def test_simulate_is_right(kind, seed):
    system, found = draw(kind, seed)
    verdict, error, said = run(system, found, 'simulate', limit=60)
    assert verdict in (RIGHT, ALARM), (error, said)
