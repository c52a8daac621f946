"""Orders whose branch has another solution than the incumbent."""

from dataclasses import replace

import numpy as np
import pytest
from problems import carried
from problems.parts import parts

from pyomo_fesd.mpcc.algorithm.arrivals import Entered
from pyomo_fesd.mpcc.algorithm.coincidences import REPLACED, Coincidences
from pyomo_fesd.mpcc.algorithm.order_branches import OPEN, SETTLED, OrderBranches
from pyomo_fesd.mpcc.algorithm.orders import Order
from pyomo_fesd.mpcc.subproblems import Stationarity, Verdict

NONE = np.zeros(0, dtype=int)


@pytest.mark.parametrize('gain, better', [(0.1, True), (-0.1, False)])
def test_another_solution_with_a_spare_place_is_gone_on_from_if_it_is_better(gain, better, monkeypatch):
    p = parts(carried.simulated_with_jump(6))
    p.branches.explore_from(p.compiled.x0, False)
    point, ways, bounds = p.run.point, OrderBranches(p.subsolves, p.branches), p.compiled.lbx.copy()
    extent = p.compiled.neighbours[0].short
    way = Entered(extent, p.subsolves.sets(point.w, 1e-8).zero, point.w, NONE)
    found = replace(point, f=point.f - gain)
    seen = []

    def certified(w, zero, **options):
        # the place may grow, and has its own least extent again
        seen.append(np.array_equal(p.compiled.lbx, bounds))
        return found

    monkeypatch.setattr(ways, '_beside', lambda point, way: (point.nlp, None))
    monkeypatch.setattr(ways, '_is_another', lambda point, other: True)
    monkeypatch.setattr(p.branches.solutions, 'certified', certified)
    assert ways._try(point, True, way) is (found if better else OPEN) and seen == [True]


def a_branch(found, monkeypatch):
    """The Parts of a simulated jump, its Coincidences, and an order with one way whose branch has the solution ``found``."""
    p = parts(carried.simulated_with_jump(6))
    p.branches.explore_from(p.compiled.x0, False)
    way = Entered(p.compiled.neighbours[0].short, p.subsolves.sets(p.run.point.w, 1e-8).zero, p.run.point.w, NONE)
    coincidences = Coincidences(p.subsolves, p.branches)
    monkeypatch.setattr(p.branches.solutions, 'certified', lambda w, zero, **options: found(p.run.point))
    monkeypatch.setattr(coincidences._ways, '_try', lambda point, inserts, way: OPEN)
    return p, coincidences, Order([way], [lambda: Verdict.UNKNOWN])


@pytest.mark.parametrize('gain, better', [(0.1, True), (-0.1, False)])
def test_a_run_goes_on_from_a_better_point_in_the_branch_of_an_order(gain, better, monkeypatch):
    p, coincidences, order = a_branch(lambda point: replace(point, f=point.f - gain), monkeypatch)
    found = coincidences._order(p.run.point, order, [])
    assert found.f == p.run.point.f - gain if better else found is OPEN


def test_the_certificate_of_a_point_does_not_look_at_points_that_no_small_step_leads_to(monkeypatch):
    p, coincidences, order = a_branch(lambda point: replace(point, f=point.f - 0.1), monkeypatch)
    assert coincidences._order(p.run.point, order, [], goes_on=False) is OPEN


def test_a_point_that_only_places_of_least_extent_keep_from_descending_is_gone_on_from(monkeypatch):
    p, coincidences, order = a_branch(lambda point: replace(point, f=point.f - 0.1), monkeypatch)
    before = p.run.point
    p.run.point = replace(before, certificate=replace(before.certificate, grade=Stationarity.LIMITED))
    monkeypatch.setattr(coincidences._orders, 'at', lambda point, sets: [order])
    assert coincidences._leads_on(p.run.point) and p.run.point.f < before.f


def test_a_point_without_places_of_least_extent_takes_the_place_of_one_whose_orders_stay_open(monkeypatch):
    p, coincidences, order = a_branch(lambda point: None, monkeypatch)
    before, other = p.run.point, replace(p.run.point, f=p.run.point.f + 1e-3)
    monkeypatch.setattr(coincidences, '_outcome', lambda point: SETTLED if point is other else OPEN)
    monkeypatch.setattr(coincidences._short, 'fewer', lambda point: other)
    coincidences.settle()
    assert p.run.point is other is not before


def test_orders_that_stayed_open_are_not_tried_again(monkeypatch):
    p, coincidences, order = a_branch(lambda point: None, monkeypatch)
    before, tried = p.run.point, []
    monkeypatch.setattr(coincidences, '_outcome', lambda point: tried.append(point) or OPEN)
    monkeypatch.setattr(coincidences._short, 'fewer', lambda point: None)
    for _ in range(2):
        p.run.point = replace(before, nlp=replace(before.nlp, w=before.w.copy()))
        coincidences.settle()
        assert p.run.point.certificate.grade is Stationarity.OPEN
    assert len(tried) == 1


@pytest.mark.parametrize('change, number', [(0.0, 1), (1e-3, 2)])
def test_a_point_to_which_a_more_even_one_leads_back_is_the_one_that_was_settled(change, number, monkeypatch):
    p, coincidences, order = a_branch(lambda point: None, monkeypatch)
    before, tried = p.run.point, []
    monkeypatch.setattr(coincidences, '_outcome', lambda point: tried.append(point) or SETTLED)
    coincidences.settle()
    w = before.w.copy()
    w[coincidences._subsolves.parts.motion[0]] += change
    p.run.point = again = replace(before, nlp=replace(before.nlp, w=w))
    coincidences.settle()
    assert len(tried) == number and p.run.point is (again if change else before)


def test_a_point_is_replaced_by_others_with_fewer_places_of_least_extent_a_few_times_only(monkeypatch):
    p, coincidences, order = a_branch(lambda point: None, monkeypatch)
    others = []

    def fewer(point):
        others.append(replace(point, f=point.f + 1e-3))
        return others[-1]

    monkeypatch.setattr(coincidences, '_outcome', lambda point: OPEN)
    monkeypatch.setattr(coincidences._short, 'fewer', fewer)
    coincidences.settle()
    assert len(others) == REPLACED and p.run.point.certificate.grade is Stationarity.OPEN


def test_the_search_that_has_led_on_last_comes_first(monkeypatch):
    p, coincidences, order = a_branch(lambda point: None, monkeypatch)
    point, asked, leads_on = p.run.point, [], 'none'
    better = replace(point, f=point.f - 0.1)

    def grown(point, ways):
        asked.append('present')
        return better if leads_on == 'present' else None

    def from_none(point, inserts, way):
        asked.append('none')
        return better if leads_on == 'none' else OPEN

    monkeypatch.setattr(coincidences._ways, 'grown', grown)
    monkeypatch.setattr(coincidences._ways, '_try', from_none)
    for leads_on, expected in (
        ('none', ['present', 'none']),
        ('none', ['none']),
        ('present', ['none', 'present']),
        ('present', ['present']),
        ('nothing', ['present', 'none']),
    ):
        asked.clear()
        assert coincidences._order(point, order, []) is (OPEN if leads_on == 'nothing' else better)
        assert asked == expected


@pytest.mark.parametrize('outcome, of_other', [(SETTLED, SETTLED), (OPEN, SETTLED), (OPEN, OPEN)])
def test_orders_are_tried_first_at_the_point_without_places_of_least_extent_beside_one_with_some(outcome, of_other, monkeypatch):
    p, coincidences, order = a_branch(lambda point: None, monkeypatch)
    before, even, tried = p.run.point, replace(p.run.point, f=p.run.point.f + 1e-3), []
    monkeypatch.setattr(p.branches, 'without_short', lambda point: even if point is before else None)
    outcomes = {even.f: outcome, before.f: of_other}
    monkeypatch.setattr(coincidences, '_outcome', lambda point: tried.append(point.f) or outcomes[point.f])
    monkeypatch.setattr(coincidences._short, 'fewer', lambda point: None)
    coincidences.settle()
    assert tried == ([even.f] if outcome is SETTLED else [even.f, before.f])
    assert p.run.point.certificate.certified == (SETTLED in (outcome, of_other))


def test_where_an_order_leads_back_from_that_point_those_of_the_other_one_are_tried_too(monkeypatch):
    p, coincidences, order = a_branch(lambda point: None, monkeypatch)
    before, even, tried = p.run.point, replace(p.run.point, f=p.run.point.f + 1e-3), []

    def outcome(point):
        tried.append(point.f)
        return before if point.f == even.f else SETTLED

    monkeypatch.setattr(p.branches, 'without_short', lambda point: None if point.f == even.f else even)
    monkeypatch.setattr(coincidences, '_outcome', outcome)
    coincidences.settle()
    assert tried == [even.f, before.f] and p.run.point.certificate.certified


def vanished(gain, grade, monkeypatch):
    """The Parts, Coincidences and order of a branch whose solution, better by ``gain``, has its place at the least extent."""
    p, coincidences, order = a_branch(lambda point: found, monkeypatch)
    point, (extent,), w = p.run.point, order.ways[0].extents, p.run.point.w.copy()
    w[extent] = p.compiled.lbx[extent]
    certificate = replace(point.certificate, grade=grade)
    found = replace(point, f=point.f - gain, nlp=replace(point.nlp, w=w), certificate=certificate)
    return p, coincidences, order, found


@pytest.mark.parametrize('gain', [0.1, -1e-3])
@pytest.mark.parametrize('grade', [Stationarity.B, Stationarity.LIMITED])
def test_an_order_whose_place_vanishes_and_leads_back_to_the_point_is_settled(gain, grade, monkeypatch):
    p, coincidences, order, found = vanished(gain, grade, monkeypatch)
    monkeypatch.setattr(p.branches, 'without_short', lambda found: p.run.point)
    assert coincidences._order(p.run.point, order, []) is SETTLED


def test_it_is_not_settled_where_that_solution_may_descend(monkeypatch):
    p, coincidences, order, found = vanished(0.1, Stationarity.DESCENT, monkeypatch)
    monkeypatch.setattr(p.branches, 'without_short', lambda found: p.run.point)
    assert coincidences._order(p.run.point, order, []) is found


def test_nor_where_its_place_has_grown(monkeypatch):
    p, coincidences, order, found = vanished(0.1, Stationarity.B, monkeypatch)
    found.w[order.ways[0].extents] += 0.1
    monkeypatch.setattr(p.branches, 'without_short', lambda found: p.run.point)
    assert coincidences._order(p.run.point, order, []) is found


@pytest.mark.parametrize('gain', [0.05, -0.05])
def test_where_the_place_is_left_out_another_point_is_gone_on_from_if_it_is_better(gain, monkeypatch):
    p, coincidences, order, found = vanished(0.1, Stationarity.B, monkeypatch)
    w = p.run.point.w.copy()
    other = replace(p.run.point, f=p.run.point.f - gain, nlp=replace(p.run.point.nlp, w=w))
    monkeypatch.setattr(p.branches, 'without_short', lambda found: other)
    monkeypatch.setattr(coincidences._ways, '_is_another', lambda point, nlp: nlp is other.nlp)
    assert coincidences._order(p.run.point, order, []) is (other if gain > 0 else found)


def test_another_motion_of_the_same_cost_settles_nothing(monkeypatch):
    p, coincidences, order, found = vanished(0.1, Stationarity.B, monkeypatch)
    w = p.run.point.w.copy()
    w[coincidences._subsolves.parts.motion[0]] += 1e-3
    other = replace(p.run.point, nlp=replace(p.run.point.nlp, w=w))
    monkeypatch.setattr(p.branches, 'without_short', lambda found: other)
    assert coincidences._order(p.run.point, order, []) is found
