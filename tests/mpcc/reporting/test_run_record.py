"""Files of a run: the log and the JSON record."""

import json

import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.contrib.solver.common.util import NoOptimalSolutionError

from pyomo_fesd import FesdError


def refuse(constant):
    raise AssertionError(f'{constant} is no strict JSON')


def read(path):
    return json.loads(path.read_text(), parse_constant=refuse)


@pytest.mark.parametrize('tee', [False, True])
@pytest.mark.parametrize('name', ['log_file', 'logfile'])
def test_the_log_goes_to_a_file_with_and_without_tee(tmp_path, capsys, tee, name):
    path = tmp_path / 'run.log'
    pyo.SolverFactory('mpec_hybrid').solve(small_mpccs.toy()[0], tee=tee, **{name: str(path)})
    log = path.read_text()
    assert log.startswith('mpec_hybrid: 2 variables') and 'certificate' in log
    assert capsys.readouterr().out == (log if tee else '')


def test_the_record_holds_what_a_bug_report_needs(tmp_path):
    path = tmp_path / 'run.json'
    m = small_mpccs.bard1()[0]
    results = SolverFactoryV2('mpec_hybrid').solve(m, json_file=path, eps_init=0.5, callback=lambda progress: None)
    record = read(path)
    assert set(record['versions']) == {'pyomo_fesd', 'pyomo', 'casadi', 'highspy', 'numpy', 'scipy', 'python', 'platform'}
    assert record['options']['eps_init'] == 0.5
    assert record['sizes']['pairs'] == 3 and record['sizes']['constraints'] == 1
    assert record['sizes']['nonzeros']['constraints'] == 5
    assert record['results']['stationarity'] == 'B'
    assert record['results']['violation'] == results.extra_info.violation
    assert record['objective'] == pytest.approx(17)
    assert record['seconds']['compile']['of which']['read']['calls'] == 1
    assert len(record['steps']) == len(results.extra_info.steps) and 'w' not in record['steps'][0]
    assert record['error'] is None


def test_an_infeasible_run_is_recorded_with_the_names(tmp_path):
    path, m = tmp_path / 'run.json', small_mpccs.toy()[0]
    m.k = pyo.Constraint(expr=m.x + m.y >= 1)
    m.e = pyo.Constraint(expr=m.x == m.y)
    with pytest.raises(NoOptimalSolutionError):
        SolverFactoryV2('mpec_hybrid').solve(m, json_file=path)
    record = read(path)
    assert 'infeasible' in record['results']['outcome'] and record['error'] is None
    assert 'c' in [name for name, _ in record['results']['violated']]


def test_a_contradiction_is_recorded_and_logged(tmp_path):
    path, m = tmp_path / 'run', small_mpccs.toy()[0]
    m.x.fix(1)
    m.k = pyo.Constraint(expr=m.x >= 2)
    pyo.SolverFactory('mpec_hybrid').solve(m, json_file=path, log_file=tmp_path / 'log', load_solutions=False)
    assert "'k'" in read(path)['results']['reason'] and read(path)['sizes'] is None
    assert 'infeasible' in (tmp_path / 'log').read_text()


def test_a_run_that_ends_in_an_error_is_recorded_with_its_steps(tmp_path):
    path = tmp_path / 'run.json'

    def fail(progress):
        raise RuntimeError('mine')

    with pytest.raises(RuntimeError):
        pyo.SolverFactory('mpec_hybrid').solve(small_mpccs.toy()[0], json_file=path, callback=fail)
    record = read(path)
    assert 'RuntimeError: mine' in record['error'] and 'Traceback' in record['error']
    assert record['sizes']['pairs'] == 1 and record['steps'][0]['kind'] == 'relaxation'


def test_a_model_that_is_refused_is_recorded_too(tmp_path):
    path, m = tmp_path / 'run.json', small_mpccs.toy()[0]
    m.n = pyo.Var(domain=pyo.Integers)
    with pytest.raises(FesdError):
        pyo.SolverFactory('mpec_hybrid').solve(m, json_file=path)
    assert 'an integer variable' in read(path)['error']
