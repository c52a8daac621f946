"""The callback after every outer iteration: what it sees, how it stops a run, what its errors do."""

import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.contrib.solver.common.results import SolutionStatus, TerminationCondition


def test_it_sees_every_relaxation_and_the_incumbent():
    m, seen, points = small_mpccs.badly_scaled()[0], [], []

    def callback(progress):
        seen.append(progress)
        points.append(progress.values())

    results = SolverFactoryV2('mpec_hybrid').solve(m, callback=callback)
    relaxations = [step for step in results.extra_info.steps if step.kind == 'relaxation']
    assert [p.iteration for p in seen] == list(range(1, len(relaxations) + 1))
    assert [p.eps for p in seen] == [step.eps for step in relaxations]
    assert [p.relaxed_objective for p in seen] == [step.f for step in relaxations]
    assert seen[-1].certified and seen[-1].incumbent == pytest.approx(results.incumbent_objective)
    assert points[-1][m.x] == pytest.approx(m.x.value)
    assert [p.seconds for p in seen] == sorted(p.seconds for p in seen)
    assert seen[-1].nlp_iterations == results.extra_info.nlp_iterations


def test_the_objective_is_in_the_models_own_sense_and_units():
    m, seen = small_mpccs.maximising()[0], []
    pyo.SolverFactory('mpec_hybrid').solve(m, callback=seen.append)
    assert seen[-1].incumbent == pytest.approx(-1)


def test_before_an_incumbent_it_sees_the_relaxation():
    m, seen = small_mpccs.toy()[0], []
    pyo.SolverFactory('mpec_hybrid').solve(m, callback=seen.append)
    assert seen[0].incumbent is None and not seen[0].certified
    assert {v.name for v in seen[0].values()} == {'x', 'y'}


def test_a_true_answer_stops_with_the_best_point():
    m = small_mpccs.badly_scaled()[0]
    options = {'callback': lambda progress: progress.certified, 'raise_exception_on_nonoptimal_result': False}
    results = SolverFactoryV2('mpec_hybrid').solve(m, **options)
    assert results.extra_info.outcome == 'stopped by the callback'
    assert results.termination_condition is TerminationCondition.interrupted
    assert results.solution_status is SolutionStatus.feasible
    assert sum(step.kind == 'relaxation' for step in results.extra_info.steps) == 1
    assert pyo.value(m.f) == pytest.approx(1)


def test_an_error_goes_through_and_the_model_stays():
    m = small_mpccs.toy(0.5, 0.25)[0]

    def fail(progress):
        raise RuntimeError('mine')

    with pytest.raises(RuntimeError, match='mine'):
        pyo.SolverFactory('mpec_hybrid').solve(m, callback=fail)
    assert (m.x.value, m.y.value) == (0.5, 0.25)
    assert set(m.component_map()) == {'x', 'y', 'c', 'f'}
    assert pyo.check_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))


def test_what_cannot_be_called_is_refused():
    with pytest.raises(ValueError, match='not callable'):
        pyo.SolverFactory('mpec_hybrid').solve(small_mpccs.toy()[0], callback=3)
