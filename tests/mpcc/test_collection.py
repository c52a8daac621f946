"""The solver on published problems: certified, and at the value that is known for the start and the option."""

import pyomo.environ as pyo
import pytest
from problems import mpcc_collection

import pyomo_fesd  # noqa: F401

RELAXATIONS = ('auto', 'scholtes', 'elastic')
TOLERANCE = 1e-6


def by_name(problem):
    return getattr(problem, 'name', None) or problem.__name__


def solve(model, **options):
    return pyo.SolverFactory('mpec_hybrid').solve(model, **options)


@pytest.mark.parametrize('relaxation', RELAXATIONS)
@pytest.mark.parametrize('known', mpcc_collection.SOLVABLE, ids=by_name)
def test_the_known_objective_is_reached_and_certified(known, relaxation):
    model = known.build()
    results = solve(model, relaxation=relaxation)
    assert results.solver.stationarity == 'B'
    assert pyo.check_optimal_termination(results)
    assert max(results.solver.violation_scaled, results.solver.complementarity_scaled) <= TOLERANCE
    # reaching the global optimum where the table expects a local one is no failure
    assert any(
        pyo.value(model.f) == pytest.approx(f, rel=TOLERANCE, abs=TOLERANCE) for f in (known.expected(relaxation), known.best)
    )


@pytest.mark.parametrize('relaxation', RELAXATIONS)
@pytest.mark.parametrize('build', mpcc_collection.INFEASIBLE, ids=by_name)
def test_infeasible(build, relaxation):
    results = solve(build(), relaxation=relaxation)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible
    assert results.solver.stationarity == 'not certified'
    assert results.solver.violated


@pytest.mark.parametrize('relaxation', RELAXATIONS)
@pytest.mark.parametrize('build', mpcc_collection.UNBOUNDED, ids=by_name)
def test_unbounded(build, relaxation):
    results = solve(build(), relaxation=relaxation)
    assert results.solver.termination_condition == pyo.TerminationCondition.unbounded


@pytest.mark.parametrize('relaxation', RELAXATIONS)
def test_without_objective(relaxation):
    model = mpcc_collection.no_objective()
    results = solve(model, relaxation=relaxation)
    assert pyo.check_optimal_termination(results)
    assert (model.x.value, model.y.value) == (pytest.approx(1), pytest.approx(1))
