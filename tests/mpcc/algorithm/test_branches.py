"""Branches: solved once, certified, kept if better, and left where the LPEC shows a way down."""

from dataclasses import replace

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import mpcc_collection, small_mpccs
from problems.parts import jump_inside_a_stage, parts
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import BranchConstraint, homotopy_hints
from pyomo_fesd.mpcc.algorithm import branch_solutions, branches
from pyomo_fesd.mpcc.algorithm.state import Outcome, Stop
from pyomo_fesd.mpcc.nlp import DIVERGING, STALLED
from pyomo_fesd.mpcc.subproblems.active_set import G_ZERO, H_ZERO, active_sets
from pyomo_fesd.mpcc.subproblems.stationarity import Stationarity


def trap(multiplier=2):
    """On x = 0 the minimum is the origin, with multipliers (-2, ``multiplier``); along y = 0 it descends to (1, 0)."""
    m = small_mpccs.pair(0.0, 0.1)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + m.y**2 + multiplier * m.y)
    return m


def c_stationary():
    """The trap with multipliers (-2, 0): a C-stationary origin."""
    return trap(0)


def two_minima(x0=0.0, y0=1.0):
    """(0, 1) with 1 and (1, 0) with 1/2: both strict, each within the other's trust region."""
    m = small_mpccs.pair(x0, y0)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 1) ** 2 / 2)
    return m


def small_sum_of_large_terms(factor=1e8):
    """f = 1 + p - 0.3 q with 0 <= p perp q >= 0, as a difference of two terms of the size ``factor``."""
    m = pyo.ConcreteModel()
    m.p, m.q = pyo.Var(bounds=(0, 1), initialize=0.5), pyo.Var(bounds=(0, 1), initialize=0)
    m.x, m.y = (pyo.Var(bounds=(-2, 2), initialize=0.5) for _ in range(2))
    m.pair = Complementarity(expr=complements(m.p >= 0, m.q >= 0))
    m.small = pyo.Constraint(expr=m.x - m.y == (1 + m.p - 0.3 * m.q) / factor)
    m.f = pyo.Objective(expr=factor * (m.x - m.y))
    return m


def at_point(m, final, **options):
    """Parts after ``explore_from`` the model's values; with the reduced LPEC by default."""
    p = parts(m, **{'lpec': 'reduced'} | options)
    p.branches.explore_from(p.compiled.x0, final)
    return p


def test_a_stationary_incumbent_is_left_along_the_lpecs_direction():
    p = at_point(trap(), True)
    assert [step.status for step in p.kinds('certificate')] == ['DESCENT', 'B']
    assert p.run.point.w == pytest.approx(p.point(x=1.0, y=0.0), abs=1e-6)


@pytest.mark.parametrize('final', [False, True])
def test_a_side_that_ipopt_leaves_above_the_tolerance_hides_no_descent(final):
    p = at_point(c_stationary(), final)  # ends at y = 6e-6
    assert p.run.point.w == pytest.approx(p.point(x=1.0, y=0.0), abs=1e-6)


def test_a_descent_within_the_round_off_of_large_terms_is_followed_where_it_matters():
    p = at_point(small_sum_of_large_terms(), True)
    first, *_, last = p.kinds('certificate')
    assert first.status == last.status == 'B' and (first.f, last.f) == pytest.approx((1, 0.7), rel=1e-6)


def test_a_descent_that_matters_and_leads_nowhere_ends_also_at_an_objective_of_zero(monkeypatch):
    p = at_point(trap(), True)
    certificate = p.run.point.certificate
    descent = replace(certificate, lpec=replace(certificate.lpec, value=-1e-6, matters=True))
    point = replace(p.run.point, f=0.0, certificate=descent)
    monkeypatch.setattr(p.branches.solutions, 'certified', lambda *given, **options: point)
    assert p.branches.descend(point, True) is None


def test_it_is_kept_uncertified_while_the_homotopy_promises_something_better():
    p = at_point(trap(), False)
    assert p.run.point.certificate.grade is Stationarity.DESCENT
    assert p.run.point.f == pytest.approx(1)


def test_a_closed_gap_lets_it_descend():
    p = parts(trap(), lpec='reduced')
    p.gap.add(1e-3, 1.0)
    p.branches.explore_from(p.compiled.x0, False)
    assert p.run.point.certificate.certified


def test_where_the_step_overshoots_the_trust_region_shrinks():
    """Down along x to 1/2, where the branch's NLP has a wall: from the step's end at 1 it is not reached, from nearby it is."""
    m = trap()
    m.wall = pyo.Constraint(expr=m.x <= 0.5)
    p = at_point(m, True)
    assert p.run.point.certificate.certified
    assert p.run.point.w == pytest.approx(p.point(x=0.5, y=0.0), abs=1e-6)


def test_a_solved_branch_is_not_solved_again_from_the_same_values():
    p = at_point(two_minima(), False)
    assert len(p.kinds('branch')) == 1
    p.branches.explore_from(p.compiled.x0, False)
    assert len(p.kinds('branch')) == 1
    p.branches.forget()
    p.branches.explore_from(p.compiled.x0, False)
    assert len(p.kinds('branch')) == 1
    p.branches.forget()
    p.branches.explore_from(p.compiled.x0 + 1e-3, False)
    assert len(p.kinds('branch')) == 2


def test_a_branch_that_fails_gets_as_many_tries_as_are_set():
    m = two_minima()
    m.far = pyo.Constraint(expr=m.x**2 + m.y >= 1.5)
    m.near = pyo.Constraint(expr=m.y + m.y**2 <= 1)
    p = parts(m)
    zero = active_sets(np.zeros(1), np.ones(1), 0.0).zero
    for _ in range(branches.TRIES + 2):
        p.branches.explore_from(p.compiled.x0, False)
    assert p.run.point is None
    assert p.branches.tried(zero)
    assert len(p.kinds('branch')) == branches.TRIES


def test_certified_comes_before_a_lower_objective():
    p = parts(two_minima(), lpec='reduced')
    for x, y in ((0.0, 1.0), (1.0, 0.0), (0.0, 1.0)):
        p.branches.explore_from(np.array(p.point(x=x, y=y)), False)
    assert p.run.point.f == pytest.approx(0.5)
    assert p.run.point.certificate.certified


@pytest.mark.parametrize(('lpec', 'best'), [('reduced', 1.0), ('full', 0.5), ('auto', 0.5)])
def test_only_the_full_lpec_looks_beyond_a_strict_minimum(lpec, best):
    p = at_point(two_minima(), True, lpec=lpec)
    assert p.run.point.certificate.grade is Stationarity.B
    assert p.run.point.f == pytest.approx(best)


@pytest.mark.parametrize('options', [{'eps_init': 1e-2}, {'eps_init': 1e-4}, {'eps_init': 1e-6}], ids=str)
@pytest.mark.parametrize(('lpec', 'best'), [('reduced', 1.0), ('full', 0.5)])
def test_so_does_the_solver_wherever_its_run_begins(options, lpec, best):
    m = two_minima(1e-3, 1.0)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, lpec=lpec, **options)
    assert results.solver.stationarity == 'B'
    assert pyo.value(m.f) == pytest.approx(best, abs=1e-6)


@pytest.mark.parametrize('lpec', ['reduced', 'full'])
def test_a_warm_start_stays_at_the_minimum_next_to_it(lpec):
    m = two_minima()
    assert pyo.SolverFactory('mpec_hybrid').solve(m, lpec=lpec, warm_start=True).solver.stationarity == 'B'
    assert pyo.value(m.f) == pytest.approx(1)


def test_the_full_lpec_reaches_the_optimum_of_bilin():
    m = mpcc_collection.bilin()
    assert pyo.SolverFactory('mpec_hybrid').solve(m, lpec='full').solver.stationarity == 'B'
    assert pyo.value(m.f) == pytest.approx(18.4)


def test_a_smaller_trust_region_keeps_the_full_lpec_near():
    p = at_point(two_minima(), True, lpec='full', trust_radius=0.1)
    assert p.run.point.f == pytest.approx(1)


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


def test_from_a_branch_that_did_not_end_only_large_steps_are_worth_it(monkeypatch):
    monkeypatch.setattr(branches, '_settles', lambda better, point: False)
    p = parts(trap(), lpec='reduced')
    point = p.branches.solutions.certified(np.zeros(2), np.array([G_ZERO]))
    unfinished = replace(point, nlp=replace(point.nlp, status='Maximum_Iterations_Exceeded'))
    # from 1 to 0
    for least, found in ((0.5, True), (1.5, False)):
        monkeypatch.setattr(branches, 'UNFINISHED', least)
        p.branches.forget()
        assert (p.branches.descend(unfinished, True) is not None) == found
    p.branches.forget()
    assert p.branches.descend(point, True).f == pytest.approx(0, abs=1e-6)


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


def test_patience_is_told_once():
    p = parts(trap(), lpec='reduced')
    assert [p.branches.be_patient(), p.branches.be_patient()] == [True, False]


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


def with_a_short_place(p):
    """The incumbent with the variables of a neighbour at their lower bound."""
    point, short = p.run.point, p.compiled.neighbours[0].short
    w = point.w.copy()
    w[short] = p.compiled.lbx[short]
    return replace(point, nlp=replace(point.nlp, w=w))


@pytest.mark.parametrize('gain, kept', [(0.5 * branch_solutions.UNEVEN, False), (2 * branch_solutions.UNEVEN, True)])
def test_a_point_with_a_place_of_least_extent_has_to_be_better_by_the_error_of_those_beside_it(gain, kept):
    p = jump_inside_a_stage()
    p.branches.solutions.at_once = True
    best = p.run.point = replace(p.run.point, f=1.0)
    short = replace(with_a_short_place(p), f=1.0 - gain)
    p.branches._keep(short)
    assert (p.run.point is short) == kept and (p.run.point is best) != kept


@pytest.mark.parametrize('violation, found', [(2 * branch_solutions.NARROW, False), (branch_solutions.NARROW / 2, True)])
def test_a_branch_that_places_of_least_extent_make_infeasible_is_solved_without_them(monkeypatch, violation, found):
    p = jump_inside_a_stage()
    p.branches.solutions.at_once = True
    end, attempt = with_a_short_place(p).nlp, p.subsolves.attempt
    zero = p.subsolves.sets(end.w, 1e-8).zero

    def contradicts(w, sides, *more, **options):
        found = attempt(w, sides, *more, **options)
        return replace(found, w=end.w, status=STALLED) if np.array_equal(sides, zero) else found

    monkeypatch.setattr(p.subsolves, 'attempt', contradicts)
    monkeypatch.setattr(p.subsolves, 'violation', lambda w: violation if np.array_equal(w, end.w) else 0.0)
    p.branches.forget()
    point = p.branches._point(end.w, zero, None, True)
    assert (point is not None) == found
    assert not found or (point.certificate.certified and p.branches.neighbours.number_of_short(point.w) == 0)


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
    monkeypatch.setattr(p.branches, 'descend', lambda *given: None)
    p.branches._widen_from(limited)
    assert p.run.point is solutions[1]
    # a point that is not lower stays where it is
    p.branches._widen_from(replace(limited, f=0.96))
    assert p.run.point is solutions[1]


@pytest.mark.parametrize('at_once', [True, False])
def test_with_decisions_of_sides_a_trust_region_that_has_led_down_grows(monkeypatch, at_once):
    p = at_point(trap(), False)
    p.branches.solutions.at_once = at_once
    point, radii = replace(p.run.point, reach=0.1), []
    lpec, better = p.subsolves.lpec, replace(p.run.point, f=p.run.point.f - 0.5)

    def watched(w, sets, radius, *more, **options):
        radii.append(radius)
        return lpec(w, sets, radius, *more, **options)

    monkeypatch.setattr(p.subsolves, 'lpec', watched)
    monkeypatch.setattr(p.branches.solutions, 'certified', lambda *given, **more: better if len(radii) > 1 else None)
    found = p.branches.descend(point, True)
    assert radii == pytest.approx([branches.GROWTH * 0.1, 0.1] if at_once else [0.1, 0.01]) and found.reach == radii[-1]


@pytest.mark.parametrize('gain, known, follows', [(0.5, True, False), (2.0, True, True), (0.5, False, True)])
def test_small_steps_are_not_worth_it_beside_a_certified_incumbent(monkeypatch, gain, known, follows):
    p = at_point(trap(), False)
    p.branches.solutions.at_once = True
    point = p.run.point
    better = replace(point, f=point.f - gain * branch_solutions.UNEVEN)
    certified = replace(point.certificate, grade=Stationarity.B)
    p.run.point = replace(point, certificate=certified) if known else point
    monkeypatch.setattr(p.branches.solutions, 'certified', lambda *given, **more: better)
    found = p.branches._within_reach(point, point.f - 1e-8, (0.1,))
    assert (found is not None) == follows


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
