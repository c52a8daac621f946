"""The example of README.md runs as it stands."""

import re
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / 'README.md'


def test_the_example_runs_as_written(capsys):
    (code,) = re.findall(r'```python\n(.*?)```', README.read_text(), flags=re.S)
    names = {}
    exec(code, names)
    m, pyomo_fesd = names['m'], names['pyomo_fesd']
    assert str(pyomo_fesd.switches(m, m.t)) == 'time 0.6666666667: sgn  below -> above'
    assert m.x[2].value == pytest.approx(4 / 3, abs=1e-9)
    assert 'solution found' in capsys.readouterr().out
