"""Files that cannot be written: refused before anything is solved, and never a reason to lose the solution."""

import io
import json

import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2

from pyomo_fesd import FesdError
from pyomo_fesd.mpcc.reporting import run_record


def solved(m, best, **options):
    results = SolverFactoryV2('mpec_hybrid').solve(m, **options)
    assert pyo.value(m.f) == pytest.approx(best, abs=1e-6)
    return results


@pytest.mark.parametrize('option', ['json_file', 'log_file'])
@pytest.mark.parametrize('where', ['nowhere/run', '.'])
def test_refused_before_anything_is_solved(option, where, tmp_path):
    m, _ = small_mpccs.scholtes4()
    before = [v.value for v in m.component_data_objects(pyo.Var)]
    with pytest.raises(FesdError, match=rf"(?s){option}='.*cannot be written.*Fix: "):
        SolverFactoryV2('mpec_hybrid').solve(m, **{option: tmp_path / where})
    assert [v.value for v in m.component_data_objects(pyo.Var)] == before


def test_a_record_that_fails_at_the_end_is_a_warning(tmp_path, caplog):
    folder = tmp_path / 'gone'
    folder.mkdir()
    path = folder / 'run.json'

    def remove(progress):
        path.unlink(missing_ok=True)
        if folder.exists():
            folder.rmdir()

    solved(*small_mpccs.scholtes4(), json_file=path, callback=remove)
    assert f"json_file='{path}'" in caplog.text and "not affected" in caplog.text


def test_a_full_disk(tmp_path, monkeypatch, caplog):
    def full(content, file, **options):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(run_record.json, 'dump', full)
    solved(*small_mpccs.scholtes4(), json_file=tmp_path / 'run.json')
    assert 'No space left' in caplog.text


class Closing(io.StringIO):
    """A stream that its reader closes after some lines."""

    def write(self, text):
        if len(self.getvalue().splitlines()) > 3:
            raise BrokenPipeError(32, 'Broken pipe')
        return super().write(text)


def test_a_log_that_fails_goes_on_elsewhere(tmp_path, caplog):
    stream, log = Closing(), tmp_path / 'run.log'
    solved(*small_mpccs.scholtes4(), tee=stream, log_file=log)
    assert 'Broken pipe' in caplog.text and caplog.text.count('WARNING') == 1
    assert log.read_text().startswith(stream.getvalue())
    assert 'certified' in log.read_text().splitlines()[-2]


def test_values_are_in_the_model_before_the_record_is_written(tmp_path, monkeypatch):
    m, best = small_mpccs.scholtes4()
    seen = []
    monkeypatch.setattr(run_record.json, 'dump', lambda content, file, **options: seen.append(pyo.value(m.f)))
    solved(m, best, json_file=tmp_path / 'run.json')
    assert seen == [pytest.approx(best, abs=1e-6)]


def test_the_record_of_a_run_without_a_certificate_has_no_error(tmp_path):
    path, m = tmp_path / 'run.json', small_mpccs.scholtes4()[0]
    SolverFactoryV2('mpec_hybrid').solve(m, json_file=path, max_iterations=1, raise_exception_on_nonoptimal_result=False)
    assert json.loads(path.read_text())['error'] is None
