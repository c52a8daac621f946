"""What an objective owes to violated rows is no progress; decisions and limits of a branch; a solution is certified once."""

from types import SimpleNamespace

import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.mpcc.algorithm.branch_solutions import BranchSolutions, _Solution
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.subproblems import Stationarity

TOLERANCES = SimpleNamespace(feasibility=1e-6)


@pytest.mark.parametrize('violation', [0.0, 1e-7, -1e-7])
def test_multipliers_say_what_a_violation_is_worth(violation):
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(bounds=(0, None), initialize=1 + violation), pyo.Var(bounds=(0, None), initialize=0)
    m.low = pyo.Constraint(expr=m.x >= 1)
    m.equal = pyo.Constraint(expr=m.x + m.y == 1)
    m.pair = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.cost = pyo.Objective(expr=300 * m.x)
    c = compile_mpcc(read_mpcc(m), HierarchicalTimer())
    lam = np.array([{'low': 200.0, 'equal': 100.0}[row.name] for row in c.constraints])
    solutions = BranchSolutions(SimpleNamespace(compiled=c, tolerances=TOLERANCES))
    owed = solutions._owed(SimpleNamespace(w=c.x0, lam_g=np.append(lam, 1e6)))
    rows, _ = c.violations(c.x0)
    assert owed == pytest.approx(sum(lam * rows), abs=1e-12) and (owed > 0) == (violation != 0)
    # x below its bound violates both rows, above it only the equation
    assert np.count_nonzero(rows) == {0.0: 0, 1e-7: 1, -1e-7: 2}[violation]


@pytest.mark.parametrize('asked, found', [([], True), ([1], True), ([1, 2], True), ([1, 2, 3], False)])
def test_decisions_that_a_solution_asks_for_are_added_some_times(asked, found):
    def solution(k):
        return SimpleNamespace(w=np.eye(4, dtype=bool)[k])

    # the last one asks for what is imposed already
    rest = [solution(k) for k in (*asked, 0)]
    subsolves = SimpleNamespace(
        compiled=SimpleNamespace(eta=SimpleNamespace(numel=lambda: 4)),
        tolerances=TOLERANCES,
        asked=lambda w, zero: w,
        branch=lambda w, zero, equal, weight, duals: rest.pop(0),
    )
    solved, equal = BranchSolutions(subsolves)._with_all(rest.pop(0), None, np.array([True, False, False, False]))
    assert (solved is not None) == found
    if found:
        assert not rest and np.flatnonzero(equal).tolist() == [0, *asked]


@pytest.mark.parametrize('at_once', [False, True])
@pytest.mark.parametrize(('pairs', 'max_iter', 'within'), [(1, 30, [TOLERANCES.feasibility]), (1, None, []), (0, 30, [])])
def test_only_a_branch_with_decisions_is_left_above_the_tolerance(at_once, pairs, max_iter, within):
    limits = []

    def attempt(*args, stalls, **more):
        limits.extend(stalls)

    compiled = SimpleNamespace(eta=SimpleNamespace(numel=lambda: 1), pairs=pairs)
    subsolves = SimpleNamespace(compiled=compiled, tolerances=TOLERANCES, attempt=attempt, asked=lambda *_: True)
    more = {} if max_iter is None else {'max_iter': max_iter}
    assert BranchSolutions(subsolves, at_once).certified(None, None, duals=True, **more) is None
    # another one comes back from violations of any size, as in pack-comp1p-32 of MacMPEC
    assert [limit.below for limit in limits] == within + [np.inf] * at_once


SOLUTION = {'w': np.array([1.0, 50.0]), 'f': 2.0, 'solved': True, 'equal': np.array([True])}
SOLUTION |= {'grade': Stationarity.B, 'descent': 0.0, 'lbx': np.zeros(2)}


@pytest.mark.parametrize(
    ('first', 'then', 'is_new'),
    [
        ({}, {'w': SOLUTION['w'] * (1 + 1e-6)}, False),
        ({'grade': Stationarity.LIMITED}, {}, False),
        ({'grade': Stationarity.DESCENT, 'descent': 1.0}, {}, False),
        ({'grade': Stationarity.DESCENT, 'descent': 1e-6}, {}, True),
        ({}, {'w': SOLUTION['w'] * (1 + 1e-4)}, True),
        ({}, {'f': 2.0 + 1e-6}, True),
        ({}, {'solved': False}, True),
        ({}, {'equal': np.array([False])}, True),
        ({}, {'lbx': np.array([0.0, 1.0])}, True),
    ],
)
def test_a_solution_that_another_branch_has_too_is_certified_once(first, then, is_new):
    def point(w, f, solved, equal, grade, descent, lbx):
        compiled.lbx = lbx
        certificates.append(SimpleNamespace(grade=grade, lpec=SimpleNamespace(descent=descent), feasible=True))
        solution = _Solution(f, nlp=SimpleNamespace(w=w, solved=solved), equal=equal)
        return solutions._point(solution, np.inf, np.inf)

    certificates, done = [], []
    certify = lambda nlp, equal: done.append(nlp) or certificates[len(done) - 1]  # noqa: E731
    compiled = SimpleNamespace(eta=SimpleNamespace(numel=lambda: 1), ubx=np.ones(2))
    solutions = BranchSolutions(SimpleNamespace(compiled=compiled, tolerances=TOLERANCES, certify=certify))
    one, other = (point(**SOLUTION | some) for some in (first, then))
    assert len(done) == 1 + is_new and (other.nlp is one.nlp) == (not is_new)


@pytest.mark.parametrize('name, solved', [([0, 1], 1), ([0, 0], 2)])
def test_a_branch_is_solved_once_whatever_the_names_of_its_sides(name, solved, monkeypatch):
    bounds = SimpleNamespace(lbx=np.zeros(2), ubx=np.ones(2))
    # the first pair leads the second one
    settles = {(1, 1): (0, 1)}
    subsolves = SimpleNamespace(
        compiled=bounds,
        tolerances=TOLERANCES,
        on_sides=lambda w, zero: w,
        settled=lambda w, zero: np.array(settles.get(tuple(zero), zero)),
    )
    solutions, runs = BranchSolutions(subsolves), []
    monkeypatch.setattr(solutions, '_solution', lambda w, zero, *_, **more: runs.append(zero) or _Solution())
    for zero in ([1, 1], name):
        assert solutions.certified(np.zeros(2), np.array(zero)) is None
    assert len(runs) == solved
