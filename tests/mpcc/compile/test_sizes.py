"""Slow and small, fast and large: the same switches in all units of time and of states."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.gdp import Disjunction
from scipy import sparse

import pyomo_fesd
from pyomo_fesd.mpcc.compile.sizes import MILD_SIZES, row_factors, variable_factors
from pyomo_fesd.mpcc.compile.sparse_entries import largest_entries, major_index
from tests.problems.running import move

SCALES = [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9]


def system(T, X, first, horizon, modes, hysteresis=False):
    """x' in two modes ``[(condition of x, rate of x)]``, in units X and T."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, horizon * T))
    m.x = pyo.Var(m.t, initialize=first * X)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(first * X)
    m.mode = Disjunction(m.t, rule=lambda m, t: [[where(m.x[t], X), m.dx[t] == rate(m.x[t], X) / T] for where, rate in modes])
    pyo.TransformationFactory('fesd.dcs').apply_to(m, **({'hysteresis': [m.mode]} if hysteresis else {}))
    return move(m, nfe=8)


def signum(T, X):
    modes = [(lambda x, X: x <= 0, lambda x, X: 3 * X), (lambda x, X: x >= 0, lambda x, X: X)]
    return system(T, X, -2, 2, modes), [2 / 3]


def tank(T, X):
    """Free outflow above a quarter of the height, a leak below: x' = -sqrt(x), then x' = -2 x."""
    modes = [
        (lambda x, X: x <= 0.25 * X, lambda x, X: -2 * x),
        (lambda x, X: x >= 0.25 * X, lambda x, X: -(X**0.5) * pyo.sqrt(x)),
    ]
    return system(T, X, 1, 2, modes), [1.0]


def relay(T, X):
    modes = [(lambda x, X: x <= X, lambda x, X: X), (lambda x, X: x >= -X, lambda x, X: -X)]
    return system(T, X, -2, 6, modes, hysteresis=True), [3.0, 5.0]


def optimise(m, **options):
    pyo.assert_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m, **options))


def simulate_and_optimise(m):
    pyomo_fesd.simulate(m)
    optimise(m, warm_start=True)


SOLVERS = {'simulate': pyomo_fesd.simulate, 'mpec_hybrid': optimise, 'both': simulate_and_optimise}
#: Without a start, hysteresis is hard for the homotopy in any unit.
CASES = [*(('simulate', b) for b in (signum, tank, relay)), ('mpec_hybrid', signum), ('mpec_hybrid', tank), ('both', relay)]


@pytest.mark.parametrize('solver, build', CASES, ids=lambda c: getattr(c, '__name__', c))
@pytest.mark.parametrize('T, X', [*((T, 1.0) for T in SCALES), *((1.0, X) for X in SCALES if X != 1), (1e-9, 1e9), (1e9, 1e-9)])
def test_switches_are_the_same_in_all_units(build, T, X, solver):
    m, exact = build(T, X)
    SOLVERS[solver](m)
    assert [s.time / T for s in pyomo_fesd.switches(m)] == pytest.approx(exact, abs=1e-7)


def test_a_parameter_is_estimated_in_any_unit_of_time():
    for T in (1e-9, 1e9):
        m, _ = signum(T, 1.0)
        m.x[0].unfix()
        m.goal = pyo.Objective(expr=(m.x[2 * T] - 1) ** 2)
        pyo.SolverFactory('mpec_hybrid').solve(m)
        assert m.x[0].value == pytest.approx(-3, abs=1e-5)


@pytest.mark.parametrize('start, warned', [(1.0, True), (-2e-9, False), (None, False)])
def test_a_state_that_is_lost_in_the_tolerances_is_named(start, warned, caplog):
    m, _ = signum(1.0, 1e-9)
    for v in m.x.values():
        if not v.fixed:
            v.set_value(start)
    pyo.SolverFactory('mpec_hybrid').solve(m, simulate_first=False)
    found = [record.message for record in caplog.records if 'its values are at most' in record.message]
    assert [message.split(':')[0] for message in found] == ['x'] * warned


# Factors


def factors(J, b, start, given=None, alike=()):
    n = len(start)
    bounds = np.full(n, -np.inf), np.full(n, np.inf)
    given = np.ones(n) if given is None else np.array(given)
    J = sparse.csr_matrix(J)
    slopes = major_index(J), J.indices, J.data
    return variable_factors(slopes, [np.array(b)], np.array(start, dtype=float), bounds, given, list(alike))


def test_mild_problems_are_left_alone():
    assert (factors([[1.0, 2.0], [0.5, -3.0]], [1.0, 0.0], [1.0, 0.0]) == 1).all()


def test_a_size_follows_from_the_data_of_the_rows():
    s = factors([[1.0, 0.0], [-1.0, 1e-7]], [2e-9, 0.0], [0.0, 0.0])
    assert s[0] == pytest.approx(1 / 2e-9, rel=0.5) and s[1] == pytest.approx(1 / 2e-2, rel=50)


@pytest.mark.parametrize('x0', [1e-12, 1e-9, 1e-6])
def test_a_small_first_value_is_no_size_where_a_rate_shows_another(x0):
    # x - x0 - dx = 0, dx = 3; and two parts p - n = x0 at the first time, p' - n' = x later, each part of one size
    J = [[1, -1, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 1, -1, 0, 0], [-1, 0, 0, 0, 1, -1]]
    found = factors(J, [x0, 3, x0, 0], [0] * 6, alike=[[2, 4], [3, 5]])
    assert found.tolist() == [1.0] * 6


def test_what_is_zero_at_a_solution_has_no_size():
    assert (factors([[1.0, 1.0]], [1.0], [1.0, 1e-9]) == 1).all()


def test_the_factor_of_the_user_counts():
    assert factors([[1.0]], [1e-9], [1e-9], given=[7.0])[0] == 7.0


def test_variables_that_are_alike_have_one_size():
    s = factors([[1.0, 0, 0]], [0.0], [1e9, 0.0, 1e-12], alike=[np.array([0, 1, 2])])
    assert len(set(s)) == 1 and s[0] == pytest.approx(1e-9, rel=0.5)


@given(st.lists(st.floats(-12, 12), min_size=1, max_size=6))
@settings(max_examples=100, deadline=None)
def test_factors_are_powers_of_two_and_bring_rows_near_one(exponents):
    J = sparse.diags([10.0**e for e in exponents]).tocsr()
    s = row_factors([largest_entries(J)], np.ones(len(exponents)))
    assert np.all(np.log2(s) == np.round(np.log2(s)))
    scaled = abs(sparse.diags(s) @ J).max(axis=1).toarray()
    assert scaled.min() >= MILD_SIZES[0] * 0.7 and scaled.max() <= MILD_SIZES[1]


def test_the_least_of_the_large_gradients_counts_and_a_row_without_a_value_is_judged_elsewhere():
    at, near = (sparse.csr_matrix([[entry] for entry in entries]) for entries in ([1e20, 1e9, np.nan], [1.0, 1.01e9, 1e9]))
    s = row_factors([largest_entries(at), largest_entries(near)], np.ones(3))
    assert s[0] == 1.0 and s[1:] == pytest.approx(1e-9, rel=0.5)


def test_a_row_of_denormal_gradients_is_left():
    """1/size would be infinite."""
    found = row_factors([np.array([5e-324, 1e-300])], np.ones(2))
    assert found[0] == 1.0 and np.isfinite(found[1]) and found[1] > 1e299
