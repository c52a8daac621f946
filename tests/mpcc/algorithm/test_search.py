"""The depth-first search over the pairs, where the homotopy and the LPEC name no feasible branch."""

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import mpcc_collection
from problems.parts import parts
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2
from pyomo.contrib.solver.common.results import TerminationCondition
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.mpcc.algorithm import search
from pyomo_fesd.mpcc.subproblems.active_set import FREE, H_ZERO
from pyomo_fesd.mpcc.subproblems.stationarity import Stationarity

ANSWER = (1, 0, 1, 1, 0, 0)
TOLERANCE = 1e-6
SEARCH = 'search over the pairs'


def lock(wrong=0.0, answer=ANSWER):
    """Each x_i is 0 or 1, and sum 2^i x_i^3 = K has one solution ``answer``, or none; the objective leads away from it.

    Linearised at x_i = 1/2 the sum says something else, so the LPEC names another branch or none.
    """
    m, pairs = pyo.ConcreteModel(), range(len(ANSWER))
    m.x = pyo.Var(pairs, bounds=(0, None), initialize=0.5)
    m.y = pyo.Var(pairs, bounds=(0, None), initialize=0.5)
    m.circle = pyo.Constraint(pairs, rule=lambda m, i: m.x[i] ** 2 + m.y[i] ** 2 == 1)
    K = sum(2**i * on for i, on in enumerate(answer)) + wrong
    m.key = pyo.Constraint(expr=sum(2**i * m.x[i] ** 3 for i in pairs) == K)
    m.c = Complementarity(pairs, rule=lambda m, i: complements(m.x[i] >= 0, m.y[i] >= 0))
    m.f = pyo.Objective(expr=sum((1 - 2 * answer[i]) * (m.y[i] - m.x[i]) for i in pairs))
    return m


def counted(branch, nodes):
    """``branch`` that appends each node's assignment to ``nodes``."""

    def solve(w, zero, *arguments, **more):
        nodes.append(zero.copy())
        return branch(w, zero, *arguments, **more)

    return solve


def distinct(nodes):
    return len({zero.tobytes() for zero in nodes})


def found(p, nodes, start=None):
    start = p.compiled.x0 if start is None else start
    return list(search.leaves(p.compiled, counted(p.subsolves.branch, nodes), start, TOLERANCE))


def test_it_finds_the_only_feasible_branch():
    p, nodes = parts(lock()), []
    (w, zero), *others = found(p, nodes)
    assert not others
    value = dict(zip((v.name for v in p.compiled.variables), w))
    assert [value[f'x[{i}]'] for i in range(len(ANSWER))] == pytest.approx(ANSWER, abs=1e-5)
    at = p.compiled.evaluate(w)
    np.testing.assert_allclose(np.where(zero == H_ZERO, at.H, at.G), 0, atol=1e-5)
    assert FREE not in zero


@pytest.mark.parametrize('answer', [(0, 1, 0, 0, 1, 1), (1, 1, 0, 0, 1, 0), (0, 0, 0, 0, 0, 1), (1, 1, 1, 0, 0, 0)], ids=str)
def test_the_solver_opens_other_locks(answer):
    m = lock(answer=answer)
    assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B'
    assert [m.x[i].value for i in m.x] == pytest.approx(answer, abs=1e-6)


def test_it_starts_with_all_pairs_free_and_fixes_one_more_at_a_time():
    p, nodes = parts(lock()), []
    found(p, nodes)
    free = [np.count_nonzero(zero == FREE) for zero in nodes]
    assert free[0] == len(ANSWER)
    assert free[1] == len(ANSWER) - 1
    assert distinct(nodes) <= 2 ** (len(ANSWER) + 1)


def test_the_solver_comes_to_it_where_relaxations_and_lpec_fail():
    m = lock()
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    assert [m.x[i].value for i in m.x] == pytest.approx(ANSWER, abs=1e-6)
    steps = results.solver.steps
    before = steps[: [step.status for step in steps].index(SEARCH)]
    assert 'lpec' in {step.kind for step in before}
    assert 'certificate' not in {step.kind for step in before}


def test_it_ends_exhausted_where_no_branch_is_feasible():
    p, nodes = parts(lock(wrong=0.5)), []
    assert found(p, nodes) == []
    assert distinct(nodes) < search.NODES
    p.branches.search(p.compiled.x0)
    assert p.run.point is None


@pytest.mark.parametrize('build', [lambda: lock(wrong=0.5), *mpcc_collection.INFEASIBLE])
def test_the_solver_then_says_locally_infeasible_with_what_contradicts(build):
    results = SolverFactoryV2('mpec_hybrid').solve(build(), raise_exception_on_nonoptimal_result=False, load_solutions=False)
    assert results.termination_condition is TerminationCondition.locallyInfeasible
    assert SEARCH in [step.status for step in results.extra_info.steps]
    assert results.extra_info.violated
    assert results.incumbent_objective is None


@pytest.mark.parametrize('limit', [0, 1, 5])
def test_it_solves_no_more_nodes_than_it_may(monkeypatch, limit):
    monkeypatch.setattr(search, 'NODES', limit)
    p, nodes = parts(lock(wrong=0.5)), []
    assert found(p, nodes) == []
    assert distinct(nodes) == limit


def doubled(wrong):
    """A lock in which each x_i is in two pairs, as in eq. (11c)."""
    m = lock(wrong)
    m.z = pyo.Var(m.x.index_set(), bounds=(0, None), initialize=0.5)
    m.same = pyo.Constraint(m.z.index_set(), rule=lambda m, i: m.z[i] == m.y[i])
    m.both = Complementarity(m.z.index_set(), rule=lambda m, i: complements(m.x[i] >= 0, m.z[i] >= 0))
    return m


def test_pairs_with_a_common_side_need_no_more_nodes():
    single, double = [], []
    for m, nodes in ((lock(wrong=0.5), single), (doubled(wrong=0.5), double)):
        assert found(parts(m), nodes) == []
    assert distinct(double) <= distinct(single)
    n = len(ANSWER)
    assert all(np.array_equal(zero[:n], zero[n:]) for zero in double)


def test_a_node_has_its_own_limit_of_iterations(monkeypatch):
    monkeypatch.setattr(search, 'ITERATIONS', 1)
    p = parts(lock())
    found(p, [])
    assert max(step.iterations for step in p.kinds('branch')) <= 1


def test_a_node_that_violates_nothing_is_a_branch_at_once():
    p, nodes = parts(mpcc_collection.kth1()), []
    ((_, zero),) = found(p, nodes)
    assert len(nodes) == 1
    assert zero[0] != FREE


def test_without_pairs_there_is_one_node():
    p, nodes = parts(mpcc_collection.plain_nlp()), []
    ((_, zero),) = found(p, nodes)
    assert (len(nodes), len(zero)) == (1, 0)


def test_a_node_that_fails_from_its_parents_solution_is_tried_from_the_start():
    p, starts = parts(lock(wrong=0.5)), []

    def branch(w, zero, *arguments, **more):
        starts.append((w, zero.copy()))
        return None if np.count_nonzero(zero != FREE) == 1 else p.subsolves.branch(w, zero, *arguments, **more)

    assert list(search.leaves(p.compiled, branch, p.compiled.x0, TOLERANCE)) == []
    assert len(starts) == 5
    for (first, zero), (second, again) in (starts[1:3], starts[3:5]):
        np.testing.assert_array_equal(zero, again)
        assert second is p.compiled.x0 and first is not second


def test_what_the_search_finds_is_certified():
    p = parts(lock())
    p.branches.search(p.compiled.x0)
    assert p.run.point.certificate.grade is Stationarity.B
