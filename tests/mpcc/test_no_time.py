"""``pyomo_fesd.mpcc`` solves MPCCs and knows no time: neither in its imports nor in its words."""

import re
from pathlib import Path

import pytest

import pyomo_fesd.mpcc

ROOM = Path(pyomo_fesd.mpcc.__file__).parent
#: Words of models over time; 'time' itself is also that of limits and logs.
WORDS = ('stages?', 'ContinuousSet', 'DerivativeVar', 'Integral', 'dae', 'hysteresis', 'memory', 'trajector(y|ies)', 'horizon')
WORDS += ('switch(es|ing)?', 'finite elements?', 'element lengths?', 'collocation', 'state jumps?', 'simulat(e|ion)', 'over time')


@pytest.mark.parametrize('path', sorted(ROOM.rglob('*.py')), ids=lambda p: p.relative_to(ROOM).as_posix())
def test_no_word_of_time(path):
    found = re.findall(rf'\b({"|".join(WORDS)})\b', path.read_text(), re.IGNORECASE)
    assert not found
