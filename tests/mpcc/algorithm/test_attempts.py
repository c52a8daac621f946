"""Attempts: a branch is solved once, and tried again where it failed."""

from dataclasses import replace

import numpy as np
import pyomo.environ as pyo
import pytest
from problems.parts import jump_inside_a_stage, parts
from problems.traps import at_point, trap, two_minima, with_a_short_place

from pyomo_fesd.mpcc.algorithm import attempts, branch_solutions
from pyomo_fesd.mpcc.nlp import STALLED
from pyomo_fesd.mpcc.subproblems.active_set import active_sets


def test_a_solved_branch_is_not_solved_again_from_the_same_values():
    p = at_point(two_minima(), False)
    assert len(p.kinds('branch')) == 1
    p.branches.explore_from(p.compiled.x0, False)
    assert len(p.kinds('branch')) == 1
    p.branches.attempts.forget()
    p.branches.explore_from(p.compiled.x0, False)
    assert len(p.kinds('branch')) == 1
    p.branches.attempts.forget()
    p.branches.explore_from(p.compiled.x0 + 1e-3, False)
    assert len(p.kinds('branch')) == 2


def test_a_branch_that_fails_gets_as_many_tries_as_are_set():
    m = two_minima()
    m.far = pyo.Constraint(expr=m.x**2 + m.y >= 1.5)
    m.near = pyo.Constraint(expr=m.y + m.y**2 <= 1)
    p = parts(m)
    zero = active_sets(np.zeros(1), np.ones(1), 0.0).zero
    for _ in range(attempts.TRIES + 2):
        p.branches.explore_from(p.compiled.x0, False)
    assert p.run.point is None
    assert p.branches.attempts.tried(zero)
    assert len(p.kinds('branch')) == attempts.TRIES


def test_a_first_attempt_has_the_iterations_of_the_second_one_with_patience():
    p = parts(trap(), lpec='reduced')
    before, p.branches.attempts.patient = p.branches.attempts.first, True
    assert (before, p.branches.attempts.first) == (branch_solutions.FIRST, branch_solutions.SECOND)


@pytest.mark.parametrize('violation, found', [(2 * branch_solutions.ALMOST, False), (branch_solutions.ALMOST / 2, True)])
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
    p.branches.attempts.forget()
    point = p.branches.attempts.point(end.w, zero, None, True)
    assert (point is not None) == found
    assert not found or (point.certificate.certified and p.branches.neighbours.number_of_short(point.w) == 0)


@pytest.mark.parametrize('part, multiplier, found', [(0.5, 1e3, True), (2.0, 1e3, False), (0.5, 1e-3, False)])
def test_a_branch_that_fails_pulls_to_a_neighbour_that_has_a_solution(monkeypatch, part, multiplier, found):
    p = jump_inside_a_stage()
    p.branches.solutions.at_once = True
    end, attempt, violation = p.run.point.nlp, p.subsolves.attempt, part * attempts.NEARBY
    zero = p.subsolves.sets(end.w, 1e-8).zero

    def contradicts(w, sides, *more, **options):
        result = attempt(w, sides, *more, **options)
        if not np.array_equal(sides, zero):
            return result
        return replace(result, w=end.w, status=STALLED, lam_x=np.full_like(result.lam_x, multiplier))

    monkeypatch.setattr(p.subsolves, 'attempt', contradicts)
    monkeypatch.setattr(p.subsolves, 'violation', lambda w: violation if np.array_equal(w, end.w) else 0.0)
    p.branches.attempts.forget()
    point = p.branches.attempts.point(end.w, zero, None, True)
    assert (point is not None) == found
    assert not found or not np.array_equal(p.subsolves.sets(point.w, 1e-8).zero, zero)
