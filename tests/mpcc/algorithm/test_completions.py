"""Rounds of relaxation, completion and branch: kept if feasible and better, certified at the end."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from problems.parts import parts

from pyomo_fesd.mpcc.algorithm.completions import AROUND, FALL, Completions
from pyomo_fesd.mpcc.nlp import STALLED
from pyomo_fesd.mpcc.nlp.deadline import Deadline
from pyomo_fesd.mpcc.subproblems import G_ZERO, H_ZERO
from pyomo_fesd.mpcc.subproblems.stationarity import Stationarity
from pyomo_fesd.solvers.options import MpecHybridConfig


def two_minima():
    """0 <= x perp y >= 0 with the minima (0, 1), 1, and (1, 0), 1/2."""
    m = small_mpccs.pair(0.0, 1.0)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 1) ** 2 / 2)
    return m


def completions(complete, deadline=None, **options):
    """The Parts of ``two_minima`` and its Completions by ``complete``, a function of x."""
    p, asked = parts(two_minima()), []
    names = [v.name for v in p.compiled.variables]

    def whole(w, seconds):
        asked.append(seconds)
        x, is_complete = complete(w[names.index('x')])
        return np.array(p.point(x=x, y=0.0 if x > 0 else 1.0)), is_complete, "completed"

    config = MpecHybridConfig()
    config.set_value(options)
    setup = SimpleNamespace(
        compiled=p.compiled, options=config, complete=whole, after=lambda run: None, deadline=deadline or Deadline()
    )
    return p, Completions(setup, p.subsolves, p.branches), asked


def one_stopped(p, monkeypatch, number=1):
    """Let the relaxation with this number end at its limit; returns the list of form, eps and limit of all, which grows."""
    relax, asked = p.subsolves.relax, []

    def stopped(form, w, eps, duals, most, fall):
        assert fall is FALL
        asked.append((form, eps, most))
        result = relax(form, w, eps, duals, most, fall)
        return replace(result, status='User_Requested_Stop') if len(asked) == number else result

    monkeypatch.setattr(p.subsolves, 'relax', stopped)
    return asked


def test_the_branch_of_the_completion_is_solved_and_certified():
    p, rounds, _ = completions(lambda x: (max(x, 0.1), True))
    rounds.follow(p.compiled.x0)
    assert p.run.point.certificate.grade is Stationarity.B
    assert p.run.point.f == pytest.approx(0.5)


def test_a_point_that_is_not_complete_still_names_a_branch():
    p, rounds, _ = completions(lambda x: (0.3, False))
    rounds.follow(p.compiled.x0)
    assert p.run.point.f == pytest.approx(0.5)


def test_a_completion_is_kept_as_it_is_if_its_branch_is_no_better():
    p, rounds, _ = completions(lambda x: (1.0, True))
    rounds._branch_of_completion(p.compiled.x0, 1.0)
    assert p.run.point.f == pytest.approx(0.5)
    assert p.run.point.certificate.grade is Stationarity.UNTRIED


def test_where_the_best_point_is_not_certified_the_best_solution_is():
    p, rounds, _ = completions(lambda x: (1.0, True))
    p.branches.descents.better = lambda point, worth: None
    none = np.zeros(0, dtype=bool)
    stopped = p.subsolves.branch(np.array(p.point(x=0.9, y=0.0)), np.array([H_ZERO]), none, 0.0, max_iter=0)
    solved = p.subsolves.branch(np.array(p.point(x=0.0, y=0.9)), np.array([G_ZERO]), none, 0.0)
    for result in (solved, replace(stopped, status=STALLED)):
        rounds._keep(result, none)
    rounds._certify(p.run.point)
    assert p.run.point.certificate.grade is Stationarity.B and p.run.point.f == pytest.approx(1.0)


def to_other_branches():
    """Completions whose branches have objectives of their own."""
    p, rounds, asked = completions(lambda x: (0.3, True))
    branch, objectives = rounds._branch_of_completion, iter(range(99))
    rounds._branch_of_completion = lambda *args: branch(*args) and float(next(objectives))
    return p, rounds, asked


def test_rounds_go_around_the_best_point_and_end_without_progress():
    p, rounds, _ = completions(lambda x: (0.3, True))
    rounds.follow(p.compiled.x0)
    eps = [entry.eps for entry in p.kinds('relaxation')]
    # the second one leads to the branch of the first one
    assert eps == pytest.approx([1, 1e-1, *AROUND])


def test_rounds_go_down_to_the_last_eps_where_their_branches_differ():
    p, rounds, _ = to_other_branches()
    rounds._down(p.compiled.x0, 1.0)
    assert [entry.eps for entry in p.kinds('relaxation')] == pytest.approx([1, 1e-1, 1e-2, 1e-3])


def test_a_relaxation_with_a_solution_that_is_known_is_not_completed_again():
    p, rounds, asked = completions(lambda x: (0.3, True))
    for _ in range(2):
        rounds._round(p.compiled.x0, 1.0)
    assert len(p.kinds('relaxation')) == 2 and len(asked) == 1


def test_relaxations_around_a_point_are_not_repeated():
    # another round of cycles, after the second path, finds no better point
    p, rounds, _ = completions(lambda x: (0.3, True))
    rounds._branch_of_completion(p.compiled.x0, 1.0)
    for _ in range(2):
        rounds._improve()
    assert [entry.eps for entry in p.kinds('relaxation')] == pytest.approx(AROUND)


@pytest.mark.parametrize('better, far_below, goes_on', [(False, True, True), (False, False, False), (True, True, False)])
def test_a_relaxation_leads_on_itself_where_the_rounds_of_a_cycle_only_promise_more(better, far_below, goes_on, monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    rounds._branch_of_completion(p.compiled.x0, 1.0)
    best, asked = rounds._best, []

    def a_round(w, eps):
        asked.append((eps, w))
        if better:
            rounds._best = replace(best, f=best.f - 1.0)
        return SimpleNamespace(w=w + 1.0), None

    monkeypatch.setattr(rounds, '_round', a_round)
    monkeypatch.setattr(rounds, '_is_far_below', lambda f: far_below)
    rounds._cycle()
    assert [eps for eps, _ in asked] == [*AROUND, *[AROUND[-1]] * goes_on]
    assert not goes_on or np.array_equal(asked[-1][1], best.w + 1.0)


def test_a_path_that_was_left_goes_on_where_the_other_one_does_not_keep_what_relaxations_promise(monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    asked = one_stopped(p, monkeypatch)
    monkeypatch.setattr(rounds, '_is_far_below', lambda f: True)
    rounds.follow(p.compiled.x0)
    forms = [form for form, *_ in asked]
    assert forms[:2] == ['scholtes', 'elastic']
    assert next(eps for form, eps, _ in asked[2:] if form == 'scholtes') == pytest.approx(1e-1)


@pytest.mark.parametrize('far_below, follows', [(True, True), (False, False)])
def test_one_more_path_follows_where_relaxations_still_promise_much_less(far_below, follows, monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    monkeypatch.setattr(rounds, '_is_far_below', lambda f: far_below)
    followed, follow = [], rounds._follow
    monkeypatch.setattr(rounds, '_follow', lambda *path: (followed.append(path), follow(*path))[1])
    rounds.follow(p.compiled.x0)
    assert ('elastic', 10.0) in [(form, eps) for form, _, eps, _ in followed] or not follows
    assert len(followed) == (3 if follows else 1)


def test_no_relaxation_follows_an_infeasible_one(monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    relax = p.subsolves.relax
    monkeypatch.setattr(p.subsolves, 'relax', lambda *args: replace(relax(*args), status='Infeasible_Problem_Detected'))
    rounds._down(p.compiled.x0, 1.0)
    assert len(p.kinds('relaxation')) == 1


@pytest.mark.parametrize('number, budgets', [(1, [200, 200, 200, 200]), (2, [200, 500, 200, 200]), (9, [200, 500, 500, 500])])
def test_the_first_relaxation_has_fewer_iterations_and_all_have_after_one_that_was_stopped(number, budgets, monkeypatch):
    p, rounds, _ = to_other_branches()
    asked = one_stopped(p, monkeypatch, number)
    rounds._follow('scholtes', p.compiled.x0, 1.0, True)
    assert [most for *_, most in asked[:4]] == budgets
    asked.clear()
    rounds._follow('elastic', p.compiled.x0, 1.0, True)
    assert {most for *_, most in asked} == {budgets[-1]}, "on another path, too"


def test_a_path_that_ends_infeasible_is_followed_by_one_of_the_other_form(monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    relax, forms = p.subsolves.relax, []

    def infeasible_in_the_first_form(form, *args):
        forms.append(form)
        result = relax(form, *args)
        return replace(result, status='Infeasible_Problem_Detected') if form == 'scholtes' else result

    monkeypatch.setattr(p.subsolves, 'relax', infeasible_in_the_first_form)
    rounds.follow(p.compiled.x0)
    assert forms[0] == 'scholtes' and set(forms[1:]) == {'elastic'}, "and nothing looks around what the first path found"
    assert p.run.point.certificate.grade is Stationarity.B


@pytest.mark.parametrize('number, forms', [(1, ['scholtes', 'elastic']), (2, ['scholtes', 'scholtes'])])
def test_a_path_whose_first_relaxation_does_not_reach_its_solution_is_left_for_the_other_form(number, forms, monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    asked = one_stopped(p, monkeypatch, number)
    rounds.follow(p.compiled.x0)
    assert [form for form, *_ in asked[:2]] == forms


@pytest.mark.parametrize('below, of_path', [(True, []), (False, [1.0])])
def test_after_a_path_that_was_left_the_other_form_goes_around_its_best_point_and_from_the_start_only_if_that_is_no_help(
    below, of_path, monkeypatch
):
    p, rounds, _ = completions(lambda x: (0.3, True))
    asked = one_stopped(p, monkeypatch)
    monkeypatch.setattr(rounds, '_best_is_below', lambda before: below)
    monkeypatch.setattr(rounds, '_is_far_below', lambda f: len(asked) == 1)
    rounds.follow(p.compiled.x0)
    assert [form for form, *_ in asked[:3]] == ['scholtes', 'elastic', 'elastic']
    assert [eps for _, eps, _ in asked[:4]] == pytest.approx([1.0, *AROUND, *of_path])


def test_another_path_goes_around_its_own_points(monkeypatch):
    # the first path has the better point, the branch of the second one is worse: relaxations begin there nevertheless
    p, rounds, _ = completions(lambda x: (0.3 if rounds._form == 'scholtes' else 0.0, True))
    relax, starts = p.subsolves.relax, []

    def relaxed(form, w, *args):
        starts.append((form, w))
        result = relax(form, w, *args)
        return replace(result, status='Infeasible_Problem_Detected') if form == 'scholtes' and len(starts) > 1 else result

    monkeypatch.setattr(p.subsolves, 'relax', relaxed)
    rounds.follow(p.compiled.x0)
    assert p.run.point.f == pytest.approx(0.5)
    around = [w for form, w in starts if form == 'elastic'][2]
    assert p.compiled.evaluate(around).f == pytest.approx(1)


def test_a_relaxation_whose_pairs_are_open_names_no_branch():
    p, rounds, asked = completions(lambda x: (0.3, True))
    result = p.subsolves.relax('scholtes', p.compiled.x0, 1.0, None, 100)
    assert not rounds._names_a_branch(replace(result, w=np.array(p.point(x=0.0, y=0.0))))
    assert rounds._names_a_branch(replace(result, w=np.array(p.point(x=1.0, y=0.0))))
    rounds._branch_of_completion(p.compiled.x0, 1.0, to_the_end=True)
    assert p.run.point is not None, "the simulation has reached the end"


def test_on_the_way_a_simulation_that_stops_needs_decided_pairs(monkeypatch):
    p, rounds, asked = completions(lambda x: (0.3, False))
    monkeypatch.setattr(rounds, '_names_a_branch', lambda relaxed: False)
    rounds._down(p.compiled.x0, 1.0)
    assert len(asked) == 4 and len(p.kinds('branch')) == 1, "the last one is a branch in any case"


@pytest.mark.parametrize('part, follows', [(0.4, True), (0.6, False)])
def test_a_second_path_follows_where_relaxations_promise_less_than_half(part, follows):
    p, rounds, _ = completions(lambda x: (0.0, True))
    rounds._round(p.compiled.x0, 1e-1)
    rounds._promise = part * p.run.point.f
    assert rounds._promising() is follows


def test_no_round_begins_after_the_deadline():
    p, rounds, asked = completions(lambda x: (0.3, True), deadline=Deadline.after(0.0))
    rounds.follow(p.compiled.x0)
    assert not asked
    assert p.run.point is None


def test_a_second_path_is_no_help_where_nothing_can_be_completed():
    p, rounds, asked = completions(lambda x: (0.0, False), lpec='reduced')
    p.subsolves.attempt = lambda *args, **more: None
    rounds.follow(p.compiled.x0)
    assert p.run.point is None and len(asked) > 0
    assert len(p.kinds('relaxation')) == 4


def test_a_completion_without_a_branch_is_judged_as_it_is():
    p, rounds, _ = completions(lambda x: (0.5, True))
    p.subsolves.attempt = lambda *args, **more: None
    rounds.follow(p.compiled.x0)
    assert p.run.point.f == pytest.approx(0.75)
    assert p.run.point.certificate.grade is Stationarity.DESCENT


@pytest.mark.parametrize('status, counts', [('User_Requested_Stop', True), ('Infeasible_Problem_Detected', False)])
def test_what_a_relaxation_promises_counts_unless_it_is_infeasible(status, counts, monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    relax = p.subsolves.relax
    monkeypatch.setattr(p.subsolves, 'relax', lambda *args: replace(relax(*args), status=status))
    relaxed, _ = rounds._round(p.compiled.x0, 1e-1)
    assert rounds._promise == (p.compiled.evaluate(relaxed.w).f if counts else -np.inf)


def test_a_relaxation_that_was_stopped_does_not_take_back_what_one_before_has_kept(monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    relax, hold = p.subsolves.relax, iter([True, False])
    monkeypatch.setattr(p.subsolves, 'relax', lambda *args: replace(relax(*args), status=STALLED))
    monkeypatch.setattr(p.subsolves, 'usable', lambda result: next(hold, True))
    monkeypatch.setattr(rounds, '_is_known', lambda relaxed: True)
    first, _ = rounds._round(p.compiled.x0, 1e-1)
    rounds._round(p.compiled.x0, 1e-2)
    assert rounds._promise == p.compiled.evaluate(first.w).f != rounds._last


def test_a_path_that_leads_away_is_the_last_one_where_nothing_better_is_promised(monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    monkeypatch.setattr(rounds, '_promising', lambda: False)
    relax, forms = p.subsolves.relax, []

    def infeasible_at_last(form, w, eps, *args):
        forms.append(form)
        result = relax(form, w, eps, *args)
        return replace(result, status='Infeasible_Problem_Detected') if len(forms) == 2 else result

    monkeypatch.setattr(p.subsolves, 'relax', infeasible_at_last)
    rounds.follow(p.compiled.x0)
    assert set(forms) == {'scholtes'} and len(forms) > 2, "relaxations go around its best point"


def test_one_more_path_follows_at_last_once(monkeypatch):
    p, rounds, _ = completions(lambda x: (0.3, True))
    rounds.follow(p.compiled.x0)
    forms, relax = [], p.subsolves.relax
    monkeypatch.setattr(p.subsolves, 'relax', lambda form, *args: (forms.append(form), relax(form, *args))[1])
    assert rounds.further(p.compiled.x0) and set(forms) == {'elastic'}
    assert p.run.point.certificate.grade is Stationarity.B
    assert not rounds.further(p.compiled.x0)


def test_a_further_path_that_ends_far_above_the_incumbent_is_not_worth_certificates(monkeypatch):
    p, rounds, _ = completions(lambda x: (0.0, True))
    rounds.follow(p.compiled.x0)
    before = p.run.point = replace(p.run.point, f=0.4)
    assert not rounds.further(p.compiled.x0), "the other minimum costs 1"
    assert p.run.point is before


def with_a_place_of_least_extent(complete, monkeypatch):
    """Completions by ``complete`` whose best point counts as one with such a place."""
    p, rounds, asked = completions(complete)
    rounds._branch_of_completion(p.compiled.x0, 1.0)
    rounds.run.point = replace(rounds.run.point, equal=np.zeros(0, dtype=bool))
    monkeypatch.setattr(p.branches.neighbours, 'number_of_short', lambda w: 1)
    return p, rounds, asked


def test_a_point_without_places_of_least_extent_is_certified_in_the_place_of_the_best_one(monkeypatch):
    p, rounds, _ = with_a_place_of_least_extent(lambda x: (0.3, True), monkeypatch)
    other = rounds._judged(p.run.point)
    monkeypatch.setattr(p.branches, 'without_short', lambda point: other)
    rounds._certify(p.run.point)
    assert p.run.point is other


def test_nor_do_they_stay_where_the_simulated_point_has_some(monkeypatch):
    p, rounds, _ = with_a_place_of_least_extent(lambda x: (0.3, True), monkeypatch)
    other, asked = rounds._judged(p.run.point), []

    def beside_the_simulated_one(point):
        asked.append(point)
        return other if len(asked) == 2 else None

    monkeypatch.setattr(p.branches, 'without_short', beside_the_simulated_one)
    monkeypatch.setattr(p.branches, 'improve_from', lambda point, final: point)
    rounds._certify(p.run.point)
    assert p.run.point is other and asked[0] is not asked[1]


@pytest.mark.parametrize('is_complete', [True, False])
def test_without_one_the_controls_of_the_best_point_are_simulated_again(is_complete, monkeypatch):
    complete = iter([True, is_complete])
    p, rounds, asked = with_a_place_of_least_extent(lambda x: (0.3, next(complete)), monkeypatch)
    before = len(asked)
    found = rounds._simulated_again(p.run.point)
    assert len(asked) == before + 1
    assert (found is None) == (not is_complete)
    assert found is None or found.certificate.grade is Stationarity.B
