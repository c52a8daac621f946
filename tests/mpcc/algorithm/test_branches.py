"""Branches: solved once, certified, kept if better, and left where the LPEC shows a way down."""

from dataclasses import replace

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from problems.parts import jump_inside_a_stage, parts
from problems.traps import at_point, trap, two_minima, with_a_short_place
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import BranchConstraint, homotopy_hints
from pyomo_fesd.mpcc.algorithm import branch_solutions
from pyomo_fesd.mpcc.algorithm.state import Outcome, Stop
from pyomo_fesd.mpcc.nlp import DIVERGING
from pyomo_fesd.mpcc.subproblems.active_set import G_ZERO, H_ZERO, active_sets
from pyomo_fesd.mpcc.subproblems.stationarity import Stationarity


def test_it_is_kept_uncertified_while_the_homotopy_promises_something_better():
    p = at_point(trap(), False)
    assert p.run.point.certificate.grade is Stationarity.DESCENT
    assert p.run.point.f == pytest.approx(1)


def test_a_closed_gap_lets_it_descend():
    p = parts(trap(), lpec='reduced')
    p.gap.add(1e-3, 1.0)
    p.branches.explore_from(p.compiled.x0, False)
    assert p.run.point.certificate.certified


def test_certified_comes_before_a_lower_objective():
    p = parts(two_minima(), lpec='reduced')
    for x, y in ((0.0, 1.0), (1.0, 0.0), (0.0, 1.0)):
        p.branches.explore_from(np.array(p.point(x=x, y=y)), False)
    assert p.run.point.f == pytest.approx(0.5)
    assert p.run.point.certificate.certified


def test_without_an_own_solution_the_lpec_names_another_branch():
    """The active sets name x = 0, which the row forbids; the LPEC over the bi-active pair says y = 0."""
    m = small_mpccs.pair(0.1, 0.2)
    m.row = pyo.Constraint(expr=m.x - m.y >= 0.05)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + m.y)
    p = parts(m)
    relaxed = p.subsolves.relax('scholtes', p.compiled.x0, 1e-2, None, None)
    p.branches.explore(relaxed, active_sets(np.zeros(1), np.full(1, 1e-3), 1.0), False)
    assert p.kinds('lpec')
    assert p.run.point.w == pytest.approx(p.point(x=1.0, y=0.0), abs=1e-6)


def many(count=40):
    """A knapsack in pairs: hard for branch and bound, with a row that keeps the bounds apart."""
    random = np.random.default_rng(5)
    m, pairs = pyo.ConcreteModel(), range(count)
    m.x = pyo.Var(pairs, bounds=(0, 1), initialize=0.0)
    m.y = pyo.Var(pairs, bounds=(0, 1), initialize=0.0)
    m.c = Complementarity(pairs, rule=lambda m, i: complements(m.x[i] >= 0, m.y[i] >= 0))
    weight = random.uniform(1, 2, (5, count))
    m.rows = pyo.Constraint(range(5), rule=lambda m, k: sum(weight[k, i] * (m.x[i] + 0.9 * m.y[i]) for i in pairs) == count / 4)
    value = random.uniform(1, 2, (2, count))
    m.f = pyo.Objective(expr=-sum(value[0, i] * m.x[i] + value[1, i] * m.y[i] for i in pairs))
    return m


@pytest.mark.parametrize('limit', [{'mip_max_nodes': 0}, {'time_limit': 0.0}], ids=str)
def test_a_suggestion_stops_at_its_limit_and_then_keeps_what_the_point_shows(monkeypatch, limit):
    monkeypatch.setattr('pyomo_fesd.mpcc.algorithm.subsolves.SUGGESTION', limit)
    monkeypatch.setattr('pyomo_fesd.mpcc.algorithm.subsolves.LEAST_TIME', limit.get('time_limit', 1e-3))
    p = parts(many())
    at = p.compiled.evaluate(p.compiled.x0)
    sets = active_sets(at.G, at.H, 1e-6)
    result = p.subsolves.suggestion(p.compiled.x0, sets, 1.0)
    assert p.kinds('lpec')[0].seconds < 2
    assert set(result.zero) <= {G_ZERO, H_ZERO}
    if not result.solved or not result.d.any():
        np.testing.assert_array_equal(result.zero, sets.zero)


def test_a_limit_of_its_own_does_not_take_an_lpec_beyond_the_deadline():
    p = parts(many(120))
    p.subsolves._lpec._deadline.at = 0.0
    at = p.compiled.evaluate(p.compiled.x0)
    result = p.subsolves._lpec.solve(p.compiled.x0, active_sets(at.G, at.H, 1e-6), 1.0, limits={'time_limit': 60.0})
    assert not result.solved or not result.d.any()


def test_a_point_beyond_all_measure_is_unbounded_only_where_the_objective_fell():
    m = small_mpccs.pair(1.0, 0.0)
    m.f = pyo.Objective(expr=-m.x)
    p = parts(m)
    with pytest.raises(Stop) as stop:
        p.branches.explore_from(p.compiled.x0, True)
    assert stop.value.outcome is Outcome.UNBOUNDED
    m, _ = small_mpccs.ralph2()
    p = parts(m)
    p.branches.explore_from(np.array(p.point(x=1e20, y=0.0)), False)
    assert p.run.point is None or p.run.point.f == pytest.approx(0, abs=1e-6)


# Decisions of the sides


def with_a_decision():
    """x, y >= 0 with one of them 0; where x > 0, z is 1."""
    m = small_mpccs.pair(1.0, 0.0)
    m.z = pyo.Var(initialize=3.0)
    m.row = pyo.Constraint(expr=m.x * m.z == 2.0)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + m.y**2)
    m.one = pyo.Constraint(expr=m.z == 1)
    m.one.deactivate()
    m.decision = Complementarity(expr=complements((m.z - 1) ** 2 >= 0, m.x / (m.x + m.y) >= 0))
    homotopy_hints(m).branch_constraints.append(BranchConstraint(m.decision, m.one))
    return m


@pytest.mark.parametrize('left, found', [(5e-3, True), (1.0, False)])
def test_a_branch_that_fails_near_its_rows_is_solved_with_the_decisions_of_its_sides(monkeypatch, left, found):
    p = parts(with_a_decision())
    attempt = p.subsolves.attempt

    def without_decisions(w, zero, equal, *more, **options):
        result = attempt(w, zero, equal, *more, **options)
        if equal is not None:
            return result
        row = p.point(x=1.0, y=0.0, z=2.0 + left)
        return replace(result, w=np.array(row), status='User_Requested_Stop')

    monkeypatch.setattr(p.subsolves, 'attempt', without_decisions)
    zero = np.full(p.compiled.pairs, H_ZERO)
    point = p.branches.solutions.certified(p.compiled.x0, zero)
    assert (point is not None) == found
    if found:
        assert point.w == pytest.approx(p.point(x=2.0, y=0.0, z=1.0), abs=1e-6) and point.equal.all()


@pytest.mark.parametrize('x, y', [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
@pytest.mark.parametrize('zero, asks', [(H_ZERO, True), (G_ZERO, False)])
def test_a_branch_asks_for_the_decisions_inside_it_wherever_it_is_looked_at(x, y, zero, asks):
    """At the origin eta is 0, though it is 1 along the whole branch on which x may be positive."""
    p = parts(with_a_decision())
    asked = p.subsolves.asked(np.array(p.point(x=x, y=y, z=3.0)), np.full(p.compiled.pairs, zero))
    assert asked.tolist() == [asks]


def test_the_best_certified_point_takes_the_place_of_one_that_is_a_little_better_but_not_certified():
    p = parts(two_minima(1.0, 0.0))
    certified = p.branches.solutions.certified(p.compiled.x0, np.full(p.compiled.pairs, H_ZERO))
    assert certified.certificate.certified
    for better_by, taken in ((2 * branch_solutions.UNEVEN, False), (branch_solutions.UNEVEN / 2, True)):
        grade = replace(certified.certificate, grade=Stationarity.LIMITED)
        p.run.point = replace(certified, f=certified.f - better_by, certificate=grade)
        p.branches.take_certified()
        assert p.run.point.certificate.certified == taken


def test_a_certified_point_stays():
    p = parts(two_minima(1.0, 0.0))
    first, other = (p.branches.solutions.certified(p.compiled.x0, np.full(p.compiled.pairs, side)) for side in (G_ZERO, H_ZERO))
    p.run.point = max(first, other, key=lambda point: point.f)
    before = p.run.point
    p.branches.take_certified()
    assert p.run.point is before


def test_a_feasible_point_is_kept_where_the_nlp_from_there_fails(monkeypatch):
    p = parts(two_minima(1.0, 0.0))
    attempt, calls = p.subsolves.attempt, []

    def stopped_then_failed(*given, **options):
        calls.append(options['max_iter'])
        result = attempt(*given, **options)
        return replace(result, status='User_Requested_Stop') if len(calls) == 1 else None

    monkeypatch.setattr(p.subsolves, 'attempt', stopped_then_failed)
    point = p.branches.solutions.certified(p.compiled.x0, np.array([H_ZERO]), max_iter=branch_solutions.FIRST)
    assert calls == [branch_solutions.FIRST, branch_solutions.SECOND]
    assert point.w == pytest.approx(p.point(x=1.0, y=0.0), abs=1e-6)


@pytest.mark.parametrize('below', [np.inf, 50.0])
def test_only_a_branch_that_is_to_be_better_is_left_where_its_multipliers_diverge(monkeypatch, below):
    p = parts(two_minima(1.0, 0.0))
    attempt, limits = p.subsolves.attempt, []

    def diverging(*given, steepest, **options):
        limits.append(steepest)
        result = attempt(*given, **options)
        return replace(result, status=DIVERGING) if steepest < np.inf else result

    monkeypatch.setattr(p.subsolves, 'attempt', diverging)
    # the point is feasible, but a solver that gave it up is not believed
    point = p.branches.solutions.certified(p.compiled.x0, np.array([H_ZERO]), below=below)
    assert (point is None) == (below < np.inf)
    assert limits == [branch_solutions.STEEP * below]


# Neighbouring branches of a moving grid


def test_a_neighbouring_branch_moves_what_changes_at_its_boundary():
    p = jump_inside_a_stage()
    at_stage = [n for n in p.compiled.neighbours if not n.short.size]
    assert len(at_stage) == 2
    # the boundary of the stages lies beside that of the jump
    assert all(p.branches.neighbours.zero_sides(p.run.point, n) is None for n in at_stage)
    assert any(p.branches.neighbours.zero_sides(p.run.point, n, wide=True) is not None for n in at_stage)


@pytest.mark.parametrize('at_once, nlps', [(True, 1), (False, 2)])
def test_with_the_decisions_of_its_sides_a_branch_takes_one_nlp(at_once, nlps):
    p = jump_inside_a_stage()
    w, before = p.run.point.w, len(p.kinds('branch'))
    zero = p.subsolves.sets(w, 1e-8).zero
    point = branch_solutions.BranchSolutions(p.subsolves, at_once).certified(w, zero, max_iter=branch_solutions.SECOND)
    assert len(p.kinds('branch')) == before + nlps and point.certificate.certified
    assert np.any(point.equal) and p.compiled.decided(point.w)[point.equal] == pytest.approx(0, abs=1e-8)


def test_branches_without_places_of_least_extent_are_those_of_all_and_of_each_one():
    p = jump_inside_a_stage()
    neighbours, point = p.branches.neighbours, p.run.point
    assert not list(neighbours.with_fewer_short(point)), "no place is at its least extent"
    short = [n for n in neighbours.all if n.short.size]
    at_bound = point.w.copy()
    for n in short:
        at_bound[n.short] = p.compiled.lbx[n.short]
    found = list(neighbours.with_fewer_short(replace(point, nlp=replace(point.nlp, w=at_bound))))
    zero = p.subsolves.sets(at_bound, 1e-8).zero
    assert len(found) > len(short) and all(np.any(other != zero) for other in found)


@pytest.mark.parametrize('gain, kept', [(0.5 * branch_solutions.UNEVEN, False), (2 * branch_solutions.UNEVEN, True)])
def test_a_point_with_a_place_of_least_extent_has_to_be_better_by_the_error_of_those_beside_it(gain, kept):
    p = jump_inside_a_stage()
    p.branches.solutions.at_once = True
    best = p.run.point = replace(p.run.point, f=1.0)
    short = replace(with_a_short_place(p), f=1.0 - gain)
    p.branches._keep(short)
    assert (p.run.point is short) == kept and (p.run.point is best) != kept


def test_a_lower_point_that_places_of_least_extent_keep_from_descending_goes_on_without_them(monkeypatch):
    p = jump_inside_a_stage()
    p.branches.solutions.at_once = True
    p.compiled.widen()
    end = with_a_short_place(p)
    limited = replace(end, f=0.9, certificate=replace(end.certificate, grade=Stationarity.LIMITED))
    p.run.point = replace(p.run.point, f=1.0)
    tried = [np.array([side]) for side in range(3)]
    solutions = {0: None, 1: replace(p.run.point, f=0.95), 2: pytest.fail}
    monkeypatch.setattr(p.branches.neighbours, 'beside_short', lambda point: iter(tried))
    monkeypatch.setattr(p.branches.solutions, 'certified', lambda w, zero, **more: solutions[int(zero[0])])
    monkeypatch.setattr(p.branches.descents, 'better', lambda *given: None)
    p.branches._widen_from(limited)
    assert p.run.point is solutions[1]
    # a point that is not lower stays where it is
    p.branches._widen_from(replace(limited, f=0.96))
    assert p.run.point is solutions[1]


@pytest.mark.parametrize('at_once', [True, False])
def test_places_of_least_extent_are_left_out(at_once):
    p = jump_inside_a_stage()
    p.branches.solutions.at_once = at_once
    point = with_a_short_place(p)
    found = p.branches.without_short(point)
    assert p.branches.without_short(p.run.point) is None, "there is none"
    if at_once:
        assert found.certificate.certified and p.branches.neighbours.number_of_short(found.w) == 0
    else:
        assert found is None


@pytest.mark.parametrize('multiplier, certified, pulls', [(0.0, True, False), (1e3, True, True), (0.0, False, True)])
def test_neighbours_of_a_certified_point_are_worth_an_nlp_where_its_multipliers_pull(multiplier, certified, pulls):
    p = jump_inside_a_stage()
    point = p.run.point
    grade = Stationarity.B if certified else Stationarity.LIMITED
    nlp = replace(point.nlp, lam_x=np.full_like(point.nlp.lam_x, multiplier))
    point = replace(point, f=1.0, nlp=nlp, certificate=replace(point.certificate, grade=grade))
    sides = (p.branches.neighbours.zero_sides(point, neighbour, always=True) for neighbour in p.branches.neighbours.all)
    found = [p.branches._pulls(point, zero) for zero in sides if zero is not None]
    assert found and any(found) == pulls


@pytest.mark.parametrize('lam_x', [np.zeros(0), np.array([np.nan])], ids=['none', 'no numbers'])
def test_a_point_without_multipliers_pulls_to_every_neighbour(lam_x):
    p = jump_inside_a_stage()
    point = p.run.point
    lam_x = np.broadcast_to(lam_x, len(point.nlp.lam_x)) if len(lam_x) else lam_x
    point = replace(point, nlp=replace(point.nlp, lam_x=lam_x))
    sides = (p.branches.neighbours.zero_sides(point, neighbour, always=True) for neighbour in p.branches.neighbours.all)
    pulls = [p.branches.neighbours.pull(point.nlp, zero) for zero in sides if zero is not None]
    assert pulls and np.inf in pulls and all(pull in (0.0, np.inf) for pull in pulls)
    assert len(lam_x) or set(pulls) == {np.inf}
