"""The example of README.md runs as given, and each shell command does its own set-up."""

import re
from pathlib import Path

import pytest

README = (Path(__file__).parents[1] / 'README.md').read_text()
SET_UP = '(python3 -m venv .venv || (sudo apt-get install -y python3-venv && python3 -m venv .venv)) && .venv/bin/pip install '


def blocks(language):
    return re.findall(rf'```{language}\n(.*?)```', README, flags=re.S)


def test_the_example_runs_as_written(capsys):
    (code,) = blocks('python')
    names = {}
    exec(code, names)
    m, pyomo_fesd = names['m'], names['pyomo_fesd']
    assert str(pyomo_fesd.switches(m, m.t)) == 'time 0.6666666667: sgn  below -> above'
    assert m.x[2].value == pytest.approx(4 / 3, abs=1e-9)
    assert 'solution found' in capsys.readouterr().out


def test_each_command_does_its_own_set_up():
    example, tests = blocks('sh')
    assert example.startswith(SET_UP) and example.endswith('.venv/bin/python examples/gas_liquid_tank.py\n')
    assert tests.startswith(SET_UP) and tests.endswith('.venv/bin/python -m pytest -n 2\n')
