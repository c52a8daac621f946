"""The path of relaxations: how eps falls, where it ends, and the mode that is nothing else."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import mpcc_collection, small_mpccs
from problems.parts import compiled
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.contrib.solver.common.results import SolutionStatus, TerminationCondition
from pyomo.contrib.solver.common.util import NoOptimalSolutionError
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import homotopy_hints
from pyomo_fesd.mpcc.algorithm.gap_test import GapTest
from pyomo_fesd.mpcc.algorithm.homotopy import Homotopy
from pyomo_fesd.mpcc.algorithm.recovery import RECOVERIES
from pyomo_fesd.mpcc.nlp import NEWTON
from pyomo_fesd.mpcc.subproblems.relaxation import RELAXATIONS

PROBLEMS = [small_mpccs.toy, small_mpccs.bard1, small_mpccs.ralph1, small_mpccs.badly_scaled, small_mpccs.mixed]
RELAXED = "relaxation solved down to the last eps; nothing is certified"


def run(m, **options):
    """Results in the new interface, without an exception."""
    return SolverFactoryV2('mpec_hybrid').solve(m, raise_exception_on_nonoptimal_result=False, **options)


def relaxations(results):
    return [step for step in results.extra_info.steps if step.kind == 'relaxation']


def product(c, step):
    at = c.evaluate(step.w)
    return np.max(at.G * at.H, initial=0.0)


# how eps falls


@pytest.mark.parametrize('mode', ['hybrid', 'relaxation'])
@pytest.mark.parametrize('form', ['scholtes', 'elastic', 'kanzow_schwartz', 'steffensen_ulbrich'])
@pytest.mark.parametrize('problem', PROBLEMS, ids=lambda f: f.__name__)
def test_the_next_eps_is_a_part_of_the_last_or_of_the_largest_product(problem, form, mode):
    m = problem()[0]
    results = run(m, mode=mode, relaxation=form, eps_factor=0.2)
    assert not any(step.kind == 'recovery' for step in results.extra_info.steps)
    c, path = compiled(m), relaxations(results)
    assert path[0].eps == 1.0
    for before, after in zip(path, path[1:]):
        assert after.eps == pytest.approx(max(0.2 * min(before.eps, product(c, before)), 1e-9))


def test_where_the_elastic_form_is_complementary_at_once_eps_jumps_to_the_end():
    m = small_mpccs.toy(0.5, 0.2)[0]
    path = relaxations(run(m, mode='relaxation', relaxation='elastic'))
    assert path[-1].eps == 1e-9
    assert len(path) < 5 < len(relaxations(run(small_mpccs.toy(0.5, 0.2)[0], mode='relaxation', relaxation='scholtes')))


def test_small_products_are_worth_a_branch_to_newtons_method_whatever_is_undecided():
    """scholtes2 of MacMPEC: its pair is bi-active at the solution."""
    m = pyo.ConcreteModel()
    m.z = pyo.Var(range(3), initialize=1)
    m.z[0].setlb(0)
    m.row = pyo.Constraint(expr=m.z[2] >= 0)
    m.pair = Complementarity(expr=complements(m.z[0] >= 0, m.z[1] - pyo.exp(m.z[0]) - pyo.exp(m.z[2]) >= 0))
    m.cost = pyo.Objective(expr=(m.z[0] + 1) ** 2 + m.z[1] ** 2 + 10 * (m.z[2] + 1) ** 2)
    results = run(m)
    assert [step.status for step in results.extra_info.steps if step.kind == 'branch'] == [NEWTON]
    assert len(relaxations(results)) == 1 and results.extra_info.stationarity == 'B'
    assert results.incumbent_objective == pytest.approx(15)


def test_a_complementary_relaxation_is_worth_a_branch_at_the_first_eps_also_with_a_bi_active_pair():
    m = pyo.ConcreteModel()
    m.x, m.y = (pyo.Var(range(4), bounds=(0, None), initialize=0.5) for _ in range(2))
    m.pairs = Complementarity(range(4), rule=lambda m, i: complements(m.x[i] >= 0, m.y[i] >= 0))
    m.f = pyo.Objective(expr=sum((m.x[i] - 1) ** 2 + 3 * m.y[i] for i in range(3)) + m.x[3] + m.y[3])
    results = run(m)
    (only,) = relaxations(results)
    assert (only.eps, only.biactive) == (1.0, 1)
    assert results.extra_info.stationarity == 'B' and abs(results.incumbent_objective) < 1e-8


def test_it_starts_and_ends_at_the_given_eps():
    path = relaxations(run(small_mpccs.toy(0.5, 0.2)[0], mode='relaxation', eps_init=0.3, eps_final=1e-4))
    assert (path[0].eps, path[-1].eps) == (0.3, 1e-4)


# where it ends


def test_a_certified_incumbent_that_the_gap_test_accepts_ends_it():
    results = run(small_mpccs.toy(0.5, 0.2)[0])
    path = relaxations(results)
    assert results.extra_info.stationarity == 'B'
    assert path[-1].eps > 1e-6
    assert results.incumbent_objective - path[-1].f < 5e-4


def test_a_failed_relaxation_is_followed_by_the_recoveries_in_their_order():
    results = run(infeasible_with_many_pairs(), relaxation='scholtes', load_solutions=False)
    notes = [step.status for step in results.extra_info.steps if step.kind == 'recovery']
    assert notes[: len(RECOVERIES)] == [recovery.note for recovery in RECOVERIES]
    eps = [step.eps for step in relaxations(results)]
    assert eps[2] == pytest.approx(eps[1] / np.sqrt(0.1))
    assert max(eps) == 100
    assert notes[len(RECOVERIES) : len(RECOVERIES) + 2] == ['search over the pairs', 'start elsewhere']


def infeasible_with_many_pairs():
    """So many pairs that not all branches are searched first."""
    m = mpcc_collection.infeasible()
    m.a, m.b = pyo.Var(range(6), bounds=(0, None), initialize=1), pyo.Var(range(6), bounds=(0, None), initialize=1)
    m.more = Complementarity(range(6), rule=lambda m, i: complements(m.a[i] >= 0, m.b[i] >= 0))
    return m


def test_no_relaxation_is_solved_twice_where_two_paths_begin_with_one_form():
    m = infeasible_with_many_pairs()
    m.no_point = pyo.Constraint(expr=sum(m.a[i] ** 2 for i in m.a) <= -1)
    steps = run(m, load_solutions=False).extra_info.steps
    notes = [step.status for step in steps if step.kind == 'recovery']
    until = steps[: [step.status for step in steps].index(RECOVERIES[0].note)]
    assert notes[:3] == ['start again, other form', 'start again, other form', RECOVERIES[0].note]
    assert [step.kind for step in until if step.kind != 'recovery'] == ['relaxation', 'relaxation']


def test_the_next_form_is_tried_before_all_branches_are_searched():
    """The elastic form falls without bound, where the row does not hold."""
    m = small_mpccs.pair(0.5, 0.5)
    m.z = pyo.Var(initialize=0.3)
    m.row = pyo.Constraint(expr=m.z == m.x * m.y)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 2) ** 2 - 100 * m.z)
    results = run(m)
    notes = [step.status for step in results.extra_info.steps if step.kind == 'recovery']
    assert notes.index('start again, other form') < notes.index('search over the pairs')
    assert results.extra_info.stationarity == 'B'


def test_a_relaxation_that_its_budget_stops_goes_on_once_from_where_it_is():
    results = run(small_mpccs.bard1()[0], relaxation_iterations=4)
    first, note, second = results.extra_info.steps[:3]
    assert (first.iterations, note.status, second.eps) == (4, 'go on', first.eps)
    assert np.array_equal(note.w, first.w)
    notes = [step.status for step in results.extra_info.steps if step.kind == 'recovery']
    assert all(after != 'go on' for before, after in zip(notes, notes[1:]) if before == 'go on')
    assert results.extra_info.stationarity == 'B'


@pytest.mark.parametrize(
    'impacts, stopped, product, goes_on',
    [([1], True, 0.2, False), ([1], True, 0.1, True), ([1], False, 0.2, True), ([], True, 0.2, True)],
)
def test_beside_impacts_a_relaxation_that_is_stopped_with_products_above_eps_has_left_the_path(impacts, stopped, product, goes_on):
    c = SimpleNamespace(impacts=impacts, evaluate=lambda w: SimpleNamespace(G=np.array([1.0]), H=np.array([product])))
    homotopy = SimpleNamespace(_c=c, _position=SimpleNamespace(eps=0.1), _subsolves=SimpleNamespace(usable=lambda result: True))
    homotopy._largest_product = partial(Homotopy._largest_product, homotopy)
    assert Homotopy._is_on_the_path(homotopy, SimpleNamespace(stopped=stopped, w=np.zeros(2))) == goes_on


@pytest.mark.parametrize(
    'impacts, eps, before, point, path, leads_up',
    [
        ([1], 1e-4, 1.0, None, 0, True),
        ([1], 1e-4, 1.2, None, 0, False),
        ([1], 1e-4, None, None, 0, False),
        ([1], 1e-2, 1.0, None, 0, False),
        ([1], 1e-4, 1.0, 'a point', 0, False),
        ([1], 1e-4, 1.0, None, 1, False),
        ([], 1e-4, 1.0, None, 0, False),
    ],
)
def test_beside_impacts_a_late_relaxation_far_above_the_one_before_leaves_the_path(impacts, eps, before, point, path, leads_up):
    duals = None if before is None else SimpleNamespace(w=before)
    position = SimpleNamespace(eps=eps, duals=duals, path=path)
    run = SimpleNamespace(point=point)
    c = SimpleNamespace(impacts=impacts, evaluate=lambda w: SimpleNamespace(f=w))
    homotopy = SimpleNamespace(_c=c, _branches='some', _paths=[1, 2], run=run)
    assert Homotopy._leads_up(homotopy, position, 1.3) == leads_up


@pytest.mark.parametrize('path, other', [(0, 2), (1, 2), (2, 3), (3, 4)])
def test_the_other_form_is_that_of_the_next_path_that_begins_differently(path, other):
    paths = [(1.0, 'elastic', 'elastic'), (0.1, 'elastic', 'elastic'), (1.0, 'scholtes', 'elastic'), (1.0, 'scholtes', 'scholtes')]
    assert Homotopy._other_form(SimpleNamespace(_paths=paths), path) == other


@pytest.mark.parametrize(
    'impacts, f, ends', [([1], 0.9, True), ([1], 1.005, True), ([1], 1.02, False), ([], 0.9, False), ([1], None, False)]
)
def test_beside_impacts_a_path_ends_where_its_incumbent_is_nearly_as_good_as_it_promises_without_a_certificate(impacts, f, ends):
    gap = GapTest(1e-6, 1e-4)
    gap.add(1e-3, 1.0)
    point = None if f is None else SimpleNamespace(f=f)
    homotopy = SimpleNamespace(_c=SimpleNamespace(impacts=impacts), _gap=gap, run=SimpleNamespace(point=point))
    assert Homotopy._promises_nothing(homotopy) == ends


def test_a_point_that_only_guide_bounds_hold_goes_on_without_them():
    m = small_mpccs.pair(0.5, 0.5)
    m.h = pyo.Var(bounds=(0, None), initialize=1)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.h - 0.2) ** 2)
    homotopy_hints(m).guide_bounds[m.h] = (0.5, 2)
    results = run(m)
    steps = results.extra_info.steps
    assert results.extra_info.stationarity == 'B' and pyo.value(m.h) == pytest.approx(0.2)
    assert [s.status for s in steps if s.kind == 'certificate'][:2] == ['LIMITED', 'B']
    assert not any('wider bounds' in s.status for s in steps)


@pytest.mark.parametrize(('length', 'path', 'again'), [(0.5, 0, True), (0.6, 0, False), (0.6, 1, True)])
def test_a_path_is_repeated_without_guide_bounds_where_these_hold_its_end_and_the_last_one_always(length, path, again):
    c = SimpleNamespace(guided=np.array([True, False]), guide_lbx=np.array([0.5, -np.inf]))
    homotopy = SimpleNamespace(_c=c, run=SimpleNamespace(point=None), _paths='ab')
    assert Homotopy._bounds_matter(homotopy, SimpleNamespace(path=path), np.array([length, 0.0])) == again


@pytest.mark.parametrize('build', [small_mpccs.bard1, mpcc_collection.no_objective])
def test_auto_begins_with_the_elastic_form(build):
    paths = [relaxations(run(model_of(build), relaxation=form)) for form in ('auto', 'elastic')]
    assert [(s.eps, s.iterations) for s in paths[0]] == [(s.eps, s.iterations) for s in paths[1]]


def model_of(build):
    made = build()
    return made[0] if isinstance(made, tuple) else made


@pytest.mark.parametrize('mode', ['hybrid', 'relaxation'])
def test_the_iteration_limit_ends_it_after_the_nlp_that_reached_it(mode):
    results = run(small_mpccs.bard1()[0], mode=mode, max_iterations=10)
    assert results.termination_condition is TerminationCondition.iterationLimit
    iterations = [step.iterations for step in results.extra_info.steps]
    assert sum(iterations) >= 10 > sum(iterations) - max(iterations)


# the mode that is nothing else


@pytest.mark.parametrize('form', ['auto', *RELAXATIONS])
def test_relaxation_mode_states_residuals_and_certifies_nothing(form):
    m = small_mpccs.bard1()[0]
    results = run(m, mode='relaxation', relaxation=form)
    info = results.extra_info
    assert info.outcome == RELAXED
    assert results.termination_condition is TerminationCondition.unknown
    feasible = max(info.complementarity_scaled, info.violation_scaled) <= 1e-6
    assert results.solution_status is (SolutionStatus.feasible if feasible else SolutionStatus.infeasible)
    assert info.stationarity == 'not certified'
    # where one side is exact, the other may be as large as sqrt(eps_final) in the forms in t
    assert info.complementarity <= 1e-4 and info.violation <= 1e-6
    assert {step.kind for step in info.steps} == {'relaxation'}
    assert (info.lpecs, info.binaries) == (0, 0)
    assert results.incumbent_objective == pytest.approx(pyo.value(m.f))
    # 17 is the optimum, another minimum has more
    assert pyo.value(m.f) >= 17 - 1e-3


def test_relaxation_mode_in_the_legacy_interface():
    m = small_mpccs.toy(0.5, 0.2)[0]
    results = pyo.SolverFactory('mpec_hybrid').solve(m, mode='relaxation')
    assert not pyo.check_optimal_termination(results)
    assert results.solver.outcome == RELAXED
    assert pyo.value(m.f) == pytest.approx(1, abs=1e-4)


def test_relaxation_mode_raises_in_the_new_interface_as_any_uncertified_point_does():
    with pytest.raises(NoOptimalSolutionError, match='nothing is certified'):
        SolverFactoryV2('mpec_hybrid').solve(small_mpccs.toy()[0], mode='relaxation')


def test_a_coarse_last_eps_leaves_a_point_that_is_called_infeasible_with_its_residual():
    results = run(small_mpccs.toy(0.5, 0.2)[0], relaxation='scholtes', mode='relaxation', eps_final=1e-2)
    assert results.extra_info.outcome == RELAXED
    assert results.solution_status is SolutionStatus.infeasible
    assert 1e-4 < results.extra_info.complementarity < 1e-1


@pytest.mark.parametrize('form', ['scholtes', 'elastic'])
def test_multipliers_of_a_relaxation_can_be_loaded_also_with_a_slack(form):
    m = small_mpccs.toy(0.5, 0.2)[0]
    costs = run(m, mode='relaxation', relaxation=form).solution_loader.get_reduced_costs()
    assert set(v.name for v in costs) == {'x', 'y'}


def test_a_limit_in_relaxation_mode_leaves_the_last_relaxation_and_not_the_first():
    results = run(small_mpccs.bard1()[0], relaxation='scholtes', mode='relaxation', max_iterations=30)
    assert results.termination_condition is TerminationCondition.iterationLimit
    assert results.incumbent_objective == pytest.approx(relaxations(results)[-1].f)
    assert results.extra_info.complementarity < 1e-4


def test_relaxation_mode_of_an_infeasible_problem():
    """The path of products ends before the last eps; that with a slack reaches it, and the residual says what is left."""
    products, slack = (run(mpcc_collection.infeasible(), mode='relaxation', relaxation=f) for f in ('scholtes', 'elastic'))
    assert products.termination_condition is TerminationCondition.locallyInfeasible
    assert products.extra_info.violated[0][0] == 'c'
    assert products.incumbent_objective is None
    assert slack.extra_info.outcome == RELAXED
    assert slack.solution_status is SolutionStatus.infeasible
    assert slack.extra_info.complementarity == pytest.approx(0.5, abs=1e-3)
