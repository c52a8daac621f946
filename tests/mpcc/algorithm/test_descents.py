"""Descents: points are left where the LPEC shows a way down, at once or in small steps."""

from dataclasses import replace

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import mpcc_collection
from problems.parts import parts
from problems.traps import at_point, c_stationary, small_sum_of_large_terms, trap, two_minima

from pyomo_fesd.mpcc.algorithm import branch_solutions, descents
from pyomo_fesd.mpcc.subproblems.active_set import G_ZERO
from pyomo_fesd.mpcc.subproblems.stationarity import Stationarity


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
    assert p.branches.descents.better(point, True) is None


def test_where_the_step_overshoots_the_trust_region_shrinks():
    """Down along x to 1/2, where the branch's NLP has a wall: from the step's end at 1 it is not reached, from nearby it is."""
    m = trap()
    m.wall = pyo.Constraint(expr=m.x <= 0.5)
    p = at_point(m, True)
    assert p.run.point.certificate.certified
    assert p.run.point.w == pytest.approx(p.point(x=0.5, y=0.0), abs=1e-6)


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


def test_from_a_branch_that_did_not_end_only_large_steps_are_worth_it(monkeypatch):
    monkeypatch.setattr(descents, '_settles', lambda better, point: False)
    p = parts(trap(), lpec='reduced')
    point = p.branches.solutions.certified(np.zeros(2), np.array([G_ZERO]))
    unfinished = replace(point, nlp=replace(point.nlp, status='Maximum_Iterations_Exceeded'))
    # from 1 to 0
    for least, found in ((0.5, True), (1.5, False)):
        monkeypatch.setattr(descents, 'UNFINISHED', least)
        p.branches.attempts.forget()
        assert (p.branches.descents.better(unfinished, True) is not None) == found
    p.branches.attempts.forget()
    assert p.branches.descents.better(point, True).f == pytest.approx(0, abs=1e-6)


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
    found = p.branches.descents.better(point, True)
    assert radii == pytest.approx([descents.GROWTH * 0.1, 0.1] if at_once else [0.1, 0.01]) and found.reach == radii[-1]


@pytest.mark.parametrize('gain, known, follows', [(0.5, True, False), (2.0, True, True), (0.5, False, True)])
def test_small_steps_are_not_worth_it_beside_a_certified_incumbent(monkeypatch, gain, known, follows):
    p = at_point(trap(), False)
    p.branches.solutions.at_once = True
    point = p.run.point
    better = replace(point, f=point.f - gain * branch_solutions.UNEVEN)
    certified = replace(point.certificate, grade=Stationarity.B)
    p.run.point = replace(point, certificate=certified) if known else point
    monkeypatch.setattr(p.branches.solutions, 'certified', lambda *given, **more: better)
    found = p.branches.descents._within_reach(point, point.f - 1e-8, (0.1,))
    assert (found is not None) == follows
