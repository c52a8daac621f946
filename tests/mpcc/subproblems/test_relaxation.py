"""The forms of Reg(eps): what eps means in each, and that each leads to certified solutions."""

import casadi as ca
import pyomo.environ as pyo
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import mpcc_collection, small_mpccs
from pyomo.contrib.solver.common.factory import SolverFactory

from pyomo_fesd.mpcc.subproblems.relaxation import RELAXATIONS, elastic, fischer_burmeister, l1, scholtes_equality

ROWS = [name for name, (_, form) in RELAXATIONS.items() if form not in (l1, elastic)]
EQUATIONS = [scholtes_equality.__name__, fischer_burmeister.__name__]
INEQUALITIES = [name for name in ROWS if name not in EQUATIONS]
#: auto, scholtes and elastic are put to the same problems in test_hybrid and test_collection.
OTHERS = [name for name in RELAXATIONS if name not in ('scholtes', 'elastic')]
side, eps = st.floats(0, 1e3), st.floats(1e-8, 1.0)


def rows(form, G, H, eps):
    """Values of a form's rows at one pair."""
    return [float(row) for row in ca.vertsplit(ca.evalf(RELAXATIONS[form][1](ca.SX(G), ca.SX(H), ca.SX(eps)).rows))]


@pytest.mark.parametrize('form', ROWS)
@given(eps=eps)
def test_eps_is_the_largest_product_of_equal_sides(form, eps):
    t = eps**0.5
    assert max(rows(form, t, t, eps)) == pytest.approx(0, abs=1e-12)
    assert max(rows(form, 1.01 * t, 1.01 * t, eps)) > 0


@pytest.mark.parametrize('form', INEQUALITIES)
@given(G=side, eps=eps)
def test_complementary_sides_are_allowed_whatever_eps_is(form, G, eps):
    for sides in ((G, 0.0), (0.0, G)):
        assert max(rows(form, *sides, eps)) <= 1e-12


@pytest.mark.parametrize('form', ROWS)
@given(G=st.floats(0, 10), H=st.floats(0, 10), eps=eps)
def test_sides_can_be_exchanged(form, G, H, eps):
    assert rows(form, G, H, eps) == pytest.approx(rows(form, H, G, eps), abs=1e-12)


@pytest.mark.parametrize('form', EQUATIONS)
@given(G=st.floats(1e-3, 1e3), eps=eps)
def test_the_central_path_is_the_product_eps(form, G, eps):
    assert rows(form, G, eps / G, eps) == pytest.approx([0], abs=1e-9)


@pytest.mark.parametrize('relaxation', OTHERS)
@pytest.mark.parametrize('problem', small_mpccs.ALL, ids=lambda f: f.__name__)
def test_published_problems_are_solved_and_certified(problem, relaxation):
    model, best = problem()
    results = pyo.SolverFactory('mpec_hybrid').solve(model, relaxation=relaxation)
    assert results.solver.stationarity == 'B'
    assert pyo.value(model.f) == pytest.approx(best, abs=1e-7)


@pytest.mark.parametrize('relaxation', OTHERS)
def test_an_equilibrium_without_objective(relaxation):
    model = mpcc_collection.no_objective()
    assert pyo.check_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(model, relaxation=relaxation))
    assert (model.x.value, model.y.value) == (pytest.approx(1), pytest.approx(1))


@pytest.mark.parametrize('relaxation', OTHERS)
@pytest.mark.parametrize('build', mpcc_collection.INFEASIBLE, ids=lambda f: f.__name__)
def test_infeasible(build, relaxation):
    results = pyo.SolverFactory('mpec_hybrid').solve(build(), relaxation=relaxation)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible


@pytest.mark.parametrize('relaxation', OTHERS)
@pytest.mark.parametrize('build', mpcc_collection.UNBOUNDED, ids=lambda f: f.__name__)
def test_unbounded(build, relaxation):
    results = pyo.SolverFactory('mpec_hybrid').solve(build(), relaxation=relaxation)
    assert results.solver.termination_condition == pyo.TerminationCondition.unbounded


def test_a_relaxation_without_a_minimum_is_given_up_early():
    # along x = y the elastic form of eps = 1 falls without bound
    model = small_mpccs.pair(1.0, 1.0)
    model.f = pyo.Objective(expr=model.x**2 + model.y**2 - 4 * model.x * model.y)
    results = SolverFactory('mpec_hybrid').solve(model)
    first = results.extra_info.steps[0]
    assert first.kind == 'relaxation' and first.iterations < 200
    assert results.extra_info.stationarity == 'B' and pyo.value(model.f) == pytest.approx(0, abs=1e-8)
