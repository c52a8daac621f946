"""The algorithm on published problems, and against enumeration of all branches on random ones."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pyomo.environ as pyo
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from problems import small_mpccs
from problems.parts import parts
from problems.surface_at_end import Surface
from pyomo.mpec import Complementarity, complements
from scipy.optimize import linprog

import pyomo_fesd
from pyomo_fesd.mpcc.algorithm import hybrid
from pyomo_fesd.mpcc.algorithm.descents import Descents
from pyomo_fesd.mpcc.algorithm.hybrid import HybridSolver
from pyomo_fesd.mpcc.algorithm.state import Outcome, Stop
from pyomo_fesd.mpcc.subproblems import G_ZERO, H_ZERO, Stationarity

SOLVER = 'mpec_hybrid'


def solve(model, **options):
    return pyo.SolverFactory(SOLVER).solve(model, **options)


@pytest.mark.parametrize('relaxation', ['auto', 'elastic', 'scholtes'])
@pytest.mark.parametrize('problem', small_mpccs.ALL, ids=lambda f: f.__name__)
def test_published_problems_are_solved_and_certified(problem, relaxation):
    model, best = problem()
    results = solve(model, relaxation=relaxation)
    assert results.solver.stationarity == 'B'
    assert pyo.check_optimal_termination(results)
    assert pyo.value(model.f) == pytest.approx(best, abs=1e-7)
    assert results.solver.complementarity <= 1e-7


def test_toy_is_solved_from_the_origin_and_from_20_random_starts():
    random = np.random.default_rng(3)
    for x0, y0 in [(0.0, 0.0), *random.uniform(0, 2, (20, 2))]:
        model, best = small_mpccs.toy(x0, y0)
        results = solve(model)
        assert results.solver.stationarity == 'B'
        assert pyo.value(model.f) == pytest.approx(best, abs=1e-9)


@pytest.mark.parametrize('steepness', [1e4, 1e7, 1e9, 1e10])
def test_a_steep_term_leaves_the_rest_of_the_objective_exact(steepness):
    m = pyo.ConcreteModel()
    m.x, m.y, m.z = (pyo.Var(bounds=(0, None), initialize=start) for start in (3, 1, 1))
    m.c = Complementarity(expr=complements(m.y >= 0, m.z >= 0))
    m.enough = pyo.Constraint(expr=m.y + m.z >= m.x)
    m.f = pyo.Objective(expr=steepness * (m.x - 1) ** 2 + m.y + 2 * m.z)
    assert solve(m).solver.stationarity == 'B'
    assert pyo.value(m.f) == pytest.approx(1 - 1 / (4 * steepness), abs=2e-6)


def test_a_complementary_point_is_not_given_up_for_a_relaxed_one():
    # rows of the relaxed one hold more exactly, and its objective is lower
    model = small_mpccs.pair(1.0, 0.0)
    model.sum = pyo.Constraint(expr=model.x + model.y == 1)
    model.f = pyo.Objective(expr=model.x**2 + model.y**2)
    p = parts(model)
    good, relaxed = (np.array(p.point(**values)) for values in ({'x': 1 + 1e-9, 'y': 0.0}, {'x': 0.5, 'y': 0.5}))
    for w in (relaxed, good, relaxed):
        p.subsolves.keep_least_infeasible(w)
    assert p.run.complementary is good


def test_infeasible_problem_is_called_infeasible_with_the_violated_pair_by_name():
    model, _ = small_mpccs.toy()
    model.sum = pyo.Constraint(expr=model.x + model.y >= 1)
    model.equal = pyo.Constraint(expr=model.x == model.y)
    results = solve(model)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible
    assert results.solver.stationarity == 'not certified'
    assert 'c' in [name for name, _ in results.solver.violated]


def test_unbounded_problem_is_called_unbounded():
    model = small_mpccs.pair(0.0, 0.0)
    model.f = pyo.Objective(expr=-model.x)
    assert solve(model).solver.termination_condition == pyo.TerminationCondition.unbounded


def test_plain_nlp_without_complementarity_is_solved():
    model = pyo.ConcreteModel()
    model.x = pyo.Var(initialize=3)
    model.f = pyo.Objective(expr=(model.x - 1) ** 2)
    assert solve(model).solver.stationarity == 'B'
    assert model.x.value == pytest.approx(1)


def test_square_system_without_objective_is_solved():
    model = small_mpccs.pair(3.0, 2.0)
    model.e = pyo.Constraint(expr=model.x - model.y == 2)
    results = solve(model)
    assert pyo.check_optimal_termination(results)
    assert (model.x.value, model.y.value) == (pytest.approx(2), pytest.approx(0))


def random_lpcc(seed, n, q):
    """min c'w over 0 <= w <= 1, A w <= b with b > 0, 0 <= w_i perp M_i w + r_i >= 0 for i < q."""
    random = np.random.default_rng(seed)
    return {
        'cost': random.normal(size=n),
        'A': random.normal(size=(2, n)),
        'b': random.uniform(0.1, 1.0, 2),
        'M': random.normal(size=(q, n)),
        'r': random.normal(size=q) * random.integers(0, 2, q),
    }


def as_model(data):
    n, q = len(data['cost']), len(data['r'])
    m = pyo.ConcreteModel()
    m.w = pyo.Var(range(n), bounds=(0, 1), initialize=0.5)

    def dot(row):
        return sum(float(a) * m.w[j] for j, a in enumerate(row))

    m.f = pyo.Objective(expr=dot(data['cost']))
    m.rows = pyo.Constraint(range(2), rule=lambda m, i: dot(data['A'][i]) <= float(data['b'][i]))
    m.c = Complementarity(range(q), rule=lambda m, i: complements(m.w[i] >= 0, dot(data['M'][i]) + float(data['r'][i]) >= 0))
    return m


def branch_values(data):
    """Optimal value of every branch (inf where infeasible), by linear programming."""
    n, q = len(data['cost']), len(data['r'])
    for zero in itertools.product((0, 1), repeat=q):
        bounds = [(0, 0 if i < q and zero[i] == 0 else 1) for i in range(n)]
        tied = [i for i in range(q) if zero[i] == 1]
        result = linprog(
            data['cost'],
            A_ub=np.vstack([data['A'], -data['M']]),
            b_ub=np.concatenate([data['b'], data['r']]),
            A_eq=data['M'][tied] if tied else None,
            b_eq=-data['r'][tied] if tied else None,
            bounds=bounds,
        )
        yield result.fun if result.status == 0 else np.inf


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 4), q=st.integers(1, 2))
@example(seed=509504, n=4, q=2)  # the only point of the path was not worth a descent on the way
def test_random_linear_problems_agree_with_enumeration(seed, n, q):
    data = random_lpcc(seed, n, q)
    values = list(branch_values(data))
    model = as_model(data)
    results = solve(model)
    if min(values) == np.inf:
        assert results.solver.termination_condition == pyo.TerminationCondition.infeasible
    else:
        assert results.solver.stationarity == 'B'
        # a certified point is the optimum of (at least) its own branch
        assert min(abs(pyo.value(model.f) - v) for v in values) < 1e-6
        assert pyomo_fesd.certify(model).certified


@pytest.mark.parametrize('product', [False, True])
def test_a_hopeless_small_problem_ends_soon(product):
    """Both sides at least 1/2 leave no branch; with a product only a search of all branches from several starts says so."""
    model, _ = small_mpccs.toy(0.3, 0.4)
    if product:
        model.x.setub(5)
        model.y.setub(5)
        model.k = pyo.Constraint(expr=model.x * model.y >= 0.25)
    else:
        model.k = pyo.Constraint(expr=model.x >= 0.5)
        model.l = pyo.Constraint(expr=model.y >= 0.5)
    results = solve(model)
    assert results.solver.termination_condition == pyo.TerminationCondition.infeasible
    assert results.solver.nlps <= (60 if product else 25)
    assert results.solver.violated


def test_a_warm_start_that_ends_uncertified_is_followed_by_the_homotopy(monkeypatch):
    monkeypatch.setattr(Descents, 'better', lambda self, point, worth: None)
    model = small_mpccs.pair(0.5, 0.0)
    model.f = pyo.Objective(expr=(model.x + 1) ** 2 + (model.y - 1) ** 2)
    kinds = [step.kind for step in solve(model, warm_start=True).solver.steps]
    # the branch y = 0 ends at the origin, and nothing is tried from there
    assert kinds[:2] == ['branch', 'certificate'] and 'relaxation' in kinds
    assert (model.x.value, model.y.value) == pytest.approx((0, 1), abs=1e-7)


def reached_at_the_end():
    """The best point reaches a surface at the last time."""
    return Surface(False, -2.0, 1.0, -2.0).build(3, 2, 'LAGRANGE-RADAU')


@pytest.mark.parametrize('build, stationarity', [(reached_at_the_end, 'not certified'), (lambda: small_mpccs.bard1()[0], 'B')])
def test_a_limit_before_all_orders_are_tried_leaves_a_certificate_only_where_there_are_none(monkeypatch, build, stationarity):
    def stop(self):
        raise Stop(Outcome.TIME_LIMIT)

    monkeypatch.setattr(HybridSolver, '_settle', stop)
    results = solve(build())
    assert results.solver.termination_condition == pyo.TerminationCondition.maxTimeLimit
    assert results.solver.stationarity == stationarity


def with_two_points(monkeypatch, is_certified):
    """A solver with the incumbent (0, 1) of 1, certified or with open orders, which has replaced (1, 0) of 1/2."""
    model = small_mpccs.pair(1.0, 0.0)
    model.f = pyo.Objective(expr=(model.x - 1) ** 2 + (model.y - 1) ** 2 / 2)
    p = parts(model)
    solver = HybridSolver(p.setup)
    low, high = (
        p.branches.solutions.certified(np.array(p.point(x=x, y=1.0 - x)), np.array([k])) for x, k in ((1.0, H_ZERO), (0.0, G_ZERO))
    )
    if not is_certified:
        high = replace(high, certificate=replace(high.certificate, grade=Stationarity.OPEN))
    solver.run.point, solver.run.lowest = high, low

    def stop(self):
        raise Stop(Outcome.TIME_LIMIT)

    monkeypatch.setitem(hybrid.MODES, 'hybrid', stop)
    return solver


@pytest.mark.parametrize('is_certified, f', [(True, 1.0), (False, 0.5)])
def test_the_lowest_point_is_the_answer_where_none_is_certified_in_the_end(monkeypatch, is_certified, f):
    solver = with_two_points(monkeypatch, is_certified)
    assert solver.solve().point.f == pytest.approx(f)


@pytest.mark.parametrize('is_certified, f', [(True, 1.0), (False, 0.5)])
def test_it_is_gone_on_from(monkeypatch, is_certified, f):
    solver = with_two_points(monkeypatch, is_certified)
    solver._try_lowest_at_last()
    assert solver.run.point.f == pytest.approx(f) and solver.run.point.certificate.certified


def test_a_certificate_that_was_stopped_early_is_made_at_last(monkeypatch):
    solver = with_two_points(monkeypatch, True)
    point = solver.run.point
    solver.run.point = replace(point, certificate=replace(point.certificate, grade=Stationarity.UNSOLVED))
    assert solver._certify_at_last() and solver.run.point.certificate.certified
    assert not solver._certify_at_last()


@pytest.mark.parametrize('completions, expected', [(None, ['even', 'orders']), ('some', ['orders', 'even', 'orders'])])
def test_orders_come_before_even_places_where_points_are_completed(completions, expected):
    asked = []
    solver = HybridSolver.__new__(HybridSolver)
    solver.run, solver._completions = SimpleNamespace(point='point'), completions
    solver._evenness = SimpleNamespace(improve=lambda: asked.append('even'))
    solver._coincidences = SimpleNamespace(settle=lambda: asked.append('orders'))
    solver._settle()
    assert asked == expected
