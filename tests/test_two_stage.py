"""The two-stage example: as one model, and by progressive hedging of mpi-sppy on two processes."""

import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pyomo.environ as pyo
import pytest
import two_stage_tank

MPIEXEC = shutil.which('mpiexec')


def number(pattern, text):
    return float(re.search(pattern, text).group(1))


def test_extensive_form(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(two_stage_tank, 'find_spec', lambda name: None)
    two_stage_tank.main()
    assert 'Extensive form: size 1.7309 m3, costs 3.75637' in capsys.readouterr().out
    assert (tmp_path / 'two_stage_tank.png').stat().st_size > 10_000


def test_the_common_size_is_the_best_one():
    # the size fixed on both sides: the storms are independent then
    def costs(size):
        total = 0.0
        for name in two_stage_tank.STORMS:
            m = two_stage_tank.build(name)
            m.size.fix(size)
            assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B'
            total += pyo.value(m.total) / len(two_stage_tank.STORMS)
        return total

    at, *beside = map(costs, (1.7309431, 1.71, 1.75))
    assert at == pytest.approx(3.75637, abs=1e-5) and all(at < other for other in beside)


@pytest.mark.skipif(find_spec('mpisppy') is None or find_spec('mpi4py') is None, reason="needs mpi-sppy and mpi4py")
@pytest.mark.skipif(MPIEXEC is None, reason="needs mpiexec")
def test_progressive_hedging_on_two_processes(tmp_path):
    root = Path(__file__).parents[1]
    run = subprocess.run(
        [
            *(MPIEXEC, '--allow-run-as-root', '--oversubscribe', '-n', '2', sys.executable, '-c'),
            f"import sys; sys.path[:0] = [{str(root)!r}, {str(root / 'examples')!r}]; import two_stage_tank; two_stage_tank.main()",
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=500,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    said = run.stdout
    assert 'on 2 process(es)' in said
    size = number(r'Extensive form: size ([\d.]+)', said)
    own = [number(rf'{name}: size ([\d.]+)', said) for name in two_stage_tank.STORMS]
    assert own == pytest.approx([size] * len(own), abs=5e-3)
    assert number(r'  costs ([\d.]+)', said) == pytest.approx(number(r'm3, costs ([\d.]+)', said), abs=1e-4)
