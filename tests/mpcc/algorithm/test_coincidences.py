"""Orders whose branch has another solution than the incumbent."""

from dataclasses import replace

import numpy as np
import pytest
from problems import carried
from problems.parts import parts

from pyomo_fesd.mpcc.algorithm.arrivals import Entered
from pyomo_fesd.mpcc.algorithm.coincidences import OPEN, SETTLED, Coincidences
from pyomo_fesd.mpcc.algorithm.orders import Order
from pyomo_fesd.mpcc.subproblems import Stationarity, Verdict

NONE = np.zeros(0, dtype=int)


@pytest.mark.parametrize('gain, better', [(0.1, True), (-0.1, False)])
def test_another_solution_with_a_spare_place_is_gone_on_from_if_it_is_better(gain, better, monkeypatch):
    p = parts(carried.simulated_with_jump(6))
    p.branches.explore_from(p.compiled.x0, False)
    point, coincidences, bounds = p.run.point, Coincidences(p.subsolves, p.branches), p.compiled.lbx.copy()
    extent = p.compiled.neighbours[0].short
    way = Entered(extent, p.subsolves.sets(point.w, 1e-8).zero, point.w, NONE)
    found = replace(point, f=point.f - gain)
    seen = []

    def certified(w, zero, **options):
        # the place may grow, and has its own least extent again
        seen.append(np.array_equal(p.compiled.lbx, bounds))
        return found

    monkeypatch.setattr(coincidences, '_beside', lambda point, way: (point.nlp, None))
    monkeypatch.setattr(coincidences, '_is_another', lambda point, other: True)
    monkeypatch.setattr(p.branches.solutions, 'certified', certified)
    assert coincidences._try(point, True, way) is (found if better else OPEN) and seen == [True]


def a_branch(found, monkeypatch):
    """The Parts of a simulated jump, its Coincidences, and an order with one way whose branch has the solution ``found``."""
    p = parts(carried.simulated_with_jump(6))
    p.branches.explore_from(p.compiled.x0, False)
    way = Entered(p.compiled.neighbours[0].short, p.subsolves.sets(p.run.point.w, 1e-8).zero, p.run.point.w, NONE)
    coincidences = Coincidences(p.subsolves, p.branches)
    monkeypatch.setattr(p.branches.solutions, 'certified', lambda w, zero, **options: found(p.run.point))
    monkeypatch.setattr(coincidences, '_try', lambda point, inserts, way: OPEN)
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
