"""Several starts: the same answer wherever they run, the best one kept, nothing lost."""

import io
import json
import os
import sys
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, replace

import numpy as np
import oscillator
import pandas as pd
import pyomo.environ as pyo
import pytest
from problems import mpcc_collection, small_mpccs
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.contrib.solver.common.results import SolutionStatus, TerminationCondition

from pyomo_fesd import FesdError
from pyomo_fesd.mpcc.algorithm.start_points import start_point
from pyomo_fesd.mpcc.algorithm.state import Start
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc

#: bilin, maximised: B-stationary points at 14.6, where the model's values lead, 16, and the optimum.
LOCAL, BEST = 14.6, 18.4


def solve(model, **options):
    """With the reduced LPEC: the full one leads from bilin's first start to the optimum."""
    return pyo.SolverFactory('mpec_hybrid').solve(model, **{'lpec': 'reduced', 'relaxation': 'scholtes'} | options)


def without_time(starts):
    return [replace(start, seconds=0.0) for start in starts]


@contextmanager
def dask():
    distributed = pytest.importorskip('distributed')
    with distributed.Client(processes=False, n_workers=2, threads_per_worker=1, dashboard_address=None) as client:
        yield client.get_executor()


EXECUTORS = {'processes': lambda: ProcessPoolExecutor(2), 'threads': lambda: ThreadPoolExecutor(3), 'dask': dask}


# the points


@pytest.fixture(scope='module')
def compiled():
    m = pyo.ConcreteModel()
    m.box, m.free = pyo.Var(bounds=(-2, 3), initialize=1), pyo.Var(initialize=50)
    m.low, m.huge = pyo.Var(bounds=(0, None), initialize=0), pyo.Var(bounds=(1, 1e10), initialize=1)
    m.fixed = pyo.Var(bounds=(4, 4), initialize=4)
    m.f = pyo.Objective(expr=m.box**2 + m.free**2 + m.low + m.huge + m.fixed)
    m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
    m.scaling_factor[m.box] = 100
    return compile_mpcc(read_mpcc(m), HierarchicalTimer())


def points(c, seed=0):
    """By name, in the model's units."""
    drawn = np.array([c.values(start_point(c, c.x0, seed, number)) for number in range(400)])
    return {v.name: drawn[:, j] for j, v in enumerate(c.variables)}


def test_start_0_is_the_models_and_the_others_depend_on_seed_and_number_only(compiled):
    c = compiled
    assert np.array_equal(start_point(c, c.x0, 7, 0), c.x0)
    assert np.array_equal(start_point(c, c.x0, 7, 5), start_point(c, c.x0, 7, 5))
    assert not np.array_equal(start_point(c, c.x0, 7, 5), start_point(c, c.x0, 8, 5))
    assert not np.array_equal(start_point(c, c.x0, 7, 5), start_point(c, c.x0, 7, 7))


def test_points_fill_finite_bounds_and_stay_near_the_model_elsewhere(compiled):
    drawn = points(compiled)
    assert -2 <= drawn['box'].min() < -1.9 and 2.9 < drawn['box'].max() <= 3
    assert drawn['low'].min() >= 0 and 10 < drawn['low'].max() <= 100
    assert drawn['huge'].min() >= 1 and drawn['huge'].max() <= 101
    assert np.abs(drawn['free'] - 50).max() <= 100 * 50
    assert set(drawn['fixed']) == {4}


def test_even_starts_leave_some_variables_alone(compiled):
    kept = points(compiled)['free'] == 50
    assert kept[2::2].any() and not kept[1::2].any()


def test_element_lengths_stay():
    m = oscillator.build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=4, ncp=1)
    c = compile_mpcc(read_mpcc(m), HierarchicalTimer())
    assert c.guided.any()
    moved = start_point(c, c.x0, 0, 1) != c.x0
    assert moved.any() and not (moved & c.guided).any()


# the answer


def test_several_starts_find_the_global_optimum_where_one_does_not():
    single, several = mpcc_collection.bilin(), mpcc_collection.bilin()
    solve(single)
    assert pyo.value(single.f) == pytest.approx(LOCAL)
    results = solve(several, starts=8)
    assert results.solver.stationarity == 'B'
    assert pyo.value(several.f) == pytest.approx(BEST)
    assert results.problem.lower_bound == pytest.approx(BEST)


def test_records_are_a_table_of_all_starts():
    results = solve(mpcc_collection.bilin(), starts=8)
    table = pd.DataFrame(results.solver.starts)
    assert list(table.start) == list(range(8))
    assert table.certified.all()
    assert table.objective[0] == pytest.approx(LOCAL) and table.objective.max() == pytest.approx(BEST)
    assert table.nlps.sum() == results.solver.nlps and table.iterations.sum() == results.solver.nlp_iterations
    assert solve(mpcc_collection.bilin()).solver.starts == []


def test_duals_belong_to_the_best_start():
    best, again = mpcc_collection.bilin(), mpcc_collection.bilin()
    for m in (best, again):
        m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
    solve(best, starts=8)
    for v, w in zip(again.component_data_objects(pyo.Var), best.component_data_objects(pyo.Var)):
        v.value = w.value
    solve(again, eps_init=1e-6)
    assert pyo.value(again.f) == pytest.approx(BEST)
    assert best.dual[best.upper] == pytest.approx(again.dual[again.upper], abs=1e-6)


@pytest.mark.parametrize('relaxation', ['auto', 'penalty'])
def test_a_start_does_not_depend_on_those_before_it(relaxation):
    """NLPs are built once for all starts; two processes solve with another history than one."""
    here = solve(mpcc_collection.bilin(), starts=6, relaxation=relaxation)
    with ProcessPoolExecutor(3) as executor:
        there = solve(mpcc_collection.bilin(), starts=6, relaxation=relaxation, executor=executor)
    assert without_time(here.solver.starts) == without_time(there.solver.starts)


@pytest.mark.parametrize('kind', EXECUTORS)
def test_every_executor_gives_the_serial_answer(kind):
    here, there = mpcc_collection.bilin(), mpcc_collection.bilin()
    serial = solve(here, starts=8, seed=5)
    with EXECUTORS[kind]() as executor:
        parallel = solve(there, starts=8, seed=5, executor=executor)
    assert without_time(serial.solver.starts) == without_time(parallel.solver.starts)
    assert [v.value for v in here.component_data_objects(pyo.Var)] == [v.value for v in there.component_data_objects(pyo.Var)]


def test_a_pool_serves_one_problem_after_the_other():
    with ProcessPoolExecutor(1) as executor:
        for _ in range(2):
            for known in (k for k in mpcc_collection.SOLVABLE if k.name in ('gauvin', 'kth3', 'jr1')):
                m = known.build()
                solve(m, starts=3, executor=executor)
                assert pyo.value(m.f) == pytest.approx(known.best, abs=1e-6)


def test_threads_leave_stderr_alone():
    before = sys.stderr
    with ThreadPoolExecutor(4) as executor:
        solve(mpcc_collection.bilin(), starts=8, executor=executor)
    assert sys.stderr is before


def test_infeasible_from_everywhere_is_infeasible():
    results = solve(mpcc_collection.infeasible_by_rows(), starts=4)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible
    assert len(results.solver.starts) == 4
    assert results.solver.violated


def test_unbounded_is_reported():
    results = solve(mpcc_collection.unbounded(), starts=4)
    assert results.solver.termination_condition == pyo.TerminationCondition.unbounded


def test_without_objective_the_first_solution_is_enough():
    m = mpcc_collection.no_objective()
    results = solve(m, starts=20)
    assert pyo.check_optimal_termination(results)
    assert len(results.solver.starts) == 1
    with ThreadPoolExecutor(1) as executor:
        results = solve(m, starts=200, executor=executor)
    assert pyo.check_optimal_termination(results)
    assert len(results.solver.starts) == 1


def test_the_log_has_one_line_a_start_and_the_spread(capsys):
    solve(mpcc_collection.bilin(), starts=8, tee=True)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ['start', 'objective', 'nlps', 'iter', 'time', 'outcome']
    assert [line.split()[0] for line in lines[2:10]] == [str(k) for k in range(8)]
    assert lines[10] == '8 starts, 8 certified with 3 distinct objective(s) from 14.6 to 18.4'
    assert lines[-2].startswith('B-stationary point found and certified')


# with the other options


def test_a_callback_sees_every_start_and_ends_them_all():
    m, seen = mpcc_collection.bilin(), []
    results = solve(m, starts=4, callback=seen.append)
    assert [s.start for s in results.solver.starts] == sorted({p.start for p in seen}) == [0, 1, 2, 3]
    for start in range(4):
        iterations = [p.iteration for p in seen if p.start == start]
        assert iterations == list(range(1, len(iterations) + 1))
    results = solve(mpcc_collection.bilin(), starts=4, callback=lambda p: p.start == 2)
    assert results.solver.outcome == 'stopped by the callback'
    assert [s.start for s in results.solver.starts] == [0, 1, 2]
    assert results.solver.stationarity == 'B'


def test_a_callback_that_an_executor_would_have_to_call_is_refused():
    with ThreadPoolExecutor(1) as executor, pytest.raises(FesdError, match='^callback: an executor'):
        solve(mpcc_collection.bilin(), starts=2, callback=print, executor=executor)


def test_files_tell_of_all_starts(tmp_path):
    log, record = tmp_path / 'run.log', tmp_path / 'run.json'
    with ProcessPoolExecutor(1) as executor:
        results = solve(mpcc_collection.bilin(), starts=3, executor=executor, log_file=log, json_file=record)
    assert log.read_text().splitlines()[1].split()[0] == 'start'
    content = json.loads(record.read_text())
    assert content['starts'] == [asdict(start) for start in results.solver.starts]
    assert content['options']['starts'] == 3


def test_the_record_of_a_failure_has_the_starts_before_it(tmp_path):
    def fail(progress):
        if progress.start == 2:
            raise RuntimeError('mine')

    with pytest.raises(RuntimeError, match='mine'):
        solve(mpcc_collection.bilin(), starts=3, callback=fail, json_file=tmp_path / 'run.json')
    content = json.loads((tmp_path / 'run.json').read_text())
    assert [start['start'] for start in content['starts']] == [0, 1]
    assert 'mine' in content['error']


@pytest.mark.parametrize('executor', [None, 'processes'])
def test_only_the_models_values_are_a_warm_start(executor):
    m = mpcc_collection.bilin()
    solve(m)
    options = {'starts': 4, 'load_solutions': False}
    cold = solve(m, **options).solver.starts
    with EXECUTORS[executor]() if executor else nullcontext() as pool:
        warm = solve(m, **options, warm_start=True, executor=pool).solver.starts
    assert warm[0].iterations < cold[0].iterations and warm[0].objective == pytest.approx(LOCAL)
    assert without_time(warm[1:]) == without_time(cold[1:])


@pytest.mark.parametrize('executor', [None, 'processes'])
def test_an_instance_is_solved_again_from_many_starts(executor):
    def build(goal):
        m = mpcc_collection.bilin()
        m.goal = pyo.Param(initialize=goal, mutable=True)
        m.low = pyo.Constraint(expr=m.f.expr <= m.goal)
        return m

    kept, solver = build(20.0), SolverFactoryV2('mpec_hybrid')
    start = [v.value for v in kept.component_data_objects(pyo.Var)]
    solver.set_instance(kept, parameters=[kept.goal])
    with EXECUTORS[executor]() if executor else nullcontext() as pool:
        for goal in (20.0, 17.0, 18.0):
            kept.goal = goal
            for v, value in zip(kept.component_data_objects(pyo.Var), start):
                v.value = value
            results = solver.solve(kept, starts=8, executor=pool)
            fresh, anew = build(goal), SolverFactoryV2('mpec_hybrid')
            anew.set_instance(fresh, parameters=[fresh.goal])
            fresh = anew.solve(fresh, starts=8)
            assert without_time(results.extra_info.starts) == without_time(fresh.extra_info.starts)
            assert pyo.value(kept.f) == pytest.approx(min(goal, BEST))


def test_all_starts_of_an_instance_share_its_nlps():
    m, solver = mpcc_collection.bilin(), SolverFactoryV2('mpec_hybrid')
    solver.set_instance(m)
    results = solver.solve(m)
    first = dict(solver._persistent.cache.nlps)
    assert first
    results = solver.solve(m, starts=5)
    assert len(results.extra_info.starts) == 5
    assert all(solver._persistent.cache.nlps[name] is nlp for name, nlp in first.items())


# limits and failures


class Faulty(ThreadPoolExecutor):
    """Runs ``fault`` instead of the starts with these numbers."""

    def __init__(self, fault, numbers):
        super().__init__(1)
        self._fault, self._numbers = fault, numbers

    def submit(self, work, job, number, x0):
        return super().submit(self._fault) if number in self._numbers else super().submit(work, job, number, x0)


def lost():
    raise RuntimeError("no such machine")


def interrupted():
    raise KeyboardInterrupt


def test_a_start_that_fails_is_recorded():
    m = mpcc_collection.bilin()
    with Faulty(lost, {0, 3}) as executor:
        results = solve(m, starts=8, executor=executor)
    assert results.solver.stationarity == 'B'
    assert pyo.value(m.f) == pytest.approx(BEST)
    assert [s.start for s in results.solver.starts if s.outcome.startswith('failed')] == [0, 3]
    assert results.solver.starts[3] == Start(3, 'failed: RuntimeError: no such machine')


def test_if_all_fail_the_first_cause_is_reported():
    with Faulty(lost, range(9)) as executor, pytest.raises(FesdError, match='every start failed.*no such machine'):
        solve(mpcc_collection.bilin(), starts=3, executor=executor)


def test_workers_that_die_are_reported():
    with ProcessPoolExecutor(1) as executor:
        executor.submit(os._exit, 1)
        with pytest.raises(FesdError, match='every start failed.*BrokenProcessPool'):
            solve(mpcc_collection.bilin(), starts=3, executor=executor)


def test_a_mistake_in_the_options_is_reported_as_without_executor():
    with ProcessPoolExecutor(1) as executor, pytest.raises(FesdError, match=r"nlp_options\['no_such_option'\]"):
        solve(small_mpccs.toy()[0], starts=3, executor=executor, nlp_options={'no_such_option': 1})


def test_options_that_cannot_be_pickled_are_reported():
    with ProcessPoolExecutor(1) as executor, pytest.raises(FesdError, match='cannot be sent to another process'):
        solve(small_mpccs.toy()[0], starts=3, executor=executor, nlp_options={'max_iter': lambda: 3})


def test_what_is_no_executor_is_refused():
    with pytest.raises(ValueError, match="no method 'submit'"):
        solve(small_mpccs.toy()[0], starts=3, executor=4)


@pytest.mark.parametrize('executor', [None, 'processes'])
def test_the_time_limit_is_that_of_all_starts(executor):
    m, began = mpcc_collection.bilin(), time.perf_counter()
    pool = ProcessPoolExecutor(1) if executor else None
    results = solve(m, starts=2000, timelimit=1.5, executor=pool)
    spent = time.perf_counter() - began
    if pool:
        pool.shutdown()
    assert results.solver.termination_condition == pyo.TerminationCondition.maxTimeLimit
    assert 1 < len(results.solver.starts) < 2000
    assert results.solver.stationarity == 'B'
    assert pyo.value(m.f) >= LOCAL - 1e-6
    assert spent < 5


def test_no_time_at_all():
    results = solve(mpcc_collection.bilin(), starts=3, timelimit=1e-6)
    assert results.solver.termination_condition == pyo.TerminationCondition.maxTimeLimit
    assert results.solver.starts == []


def test_answers_that_never_come_are_recorded(monkeypatch):
    class Silent:
        """Never runs anything."""

        def submit(self, *work):
            return Future()

    monkeypatch.setattr('pyomo_fesd.mpcc.multistart.multistart.LATE', 0.1)
    with pytest.raises(FesdError, match='no answer'):
        # time enough to compile, also on a machine with other work
        solve(mpcc_collection.bilin(), starts=3, timelimit=2, executor=Silent())

    class Halting(ThreadPoolExecutor):
        """Answers start 0 only."""

        def submit(self, work, job, number, x0):
            return Future() if number else super().submit(work, job, number, x0)

    with Halting(1) as executor:
        results = solve(mpcc_collection.bilin(), starts=3, timelimit=2, executor=executor)
    assert results.solver.termination_condition == pyo.TerminationCondition.maxTimeLimit
    assert [s.outcome for s in results.solver.starts[1:]] == ['failed: no answer in time'] * 2
    assert results.solver.stationarity == 'B'


def test_ctrl_c_keeps_the_best_of_the_starts_that_ended():
    model, executor = mpcc_collection.bilin(), Faulty(interrupted, range(3, 100))
    options = {'starts': 100, 'raise_exception_on_nonoptimal_result': False}
    results = SolverFactoryV2('mpec_hybrid').solve(model, executor=executor, **options)
    executor.shutdown()
    assert results.termination_condition is TerminationCondition.interrupted
    assert results.solution_status is SolutionStatus.feasible
    assert [s.start for s in results.extra_info.starts] == [0, 1, 2]
    assert pyo.value(model.f) == pytest.approx(BEST)


def test_ctrl_c_while_starts_are_handed_over_keeps_what_has_ended():
    class Slow(ThreadPoolExecutor):
        """Pressed when start 4 is handed over, long after start 0 has ended."""

        def submit(self, work, job, number, x0):
            if number == 4:
                raise KeyboardInterrupt
            future = super().submit(work, job, number, x0)
            future.result()
            return future

    m, executor = mpcc_collection.bilin(), Slow(1)
    results = solve(m, starts=100, executor=executor)
    executor.shutdown()
    assert results.solver.termination_condition == pyo.TerminationCondition.resourceInterrupt
    assert [s.start for s in results.solver.starts] == [0, 1, 2, 3]
    assert pyo.value(m.f) == pytest.approx(BEST)


def test_ctrl_c_in_this_process():
    class Press(io.StringIO):
        """Pressed while the line of start 2 is written."""

        def write(self, text):
            if text.startswith('    2 '):
                raise KeyboardInterrupt
            return super().write(text)

    m = mpcc_collection.bilin()
    results = solve(m, starts=100, tee=Press())
    assert results.solver.termination_condition == pyo.TerminationCondition.resourceInterrupt
    assert len(results.solver.starts) == 3
    assert pyo.value(m.f) == pytest.approx(BEST)
