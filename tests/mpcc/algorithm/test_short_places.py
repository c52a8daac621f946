"""Points with fewer places of least extent."""

from dataclasses import replace

import numpy as np
import pytest
from problems.parts import jump_inside_a_stage

from pyomo_fesd.mpcc.algorithm import branch_solutions
from pyomo_fesd.mpcc.algorithm.short_places import ShortPlaces
from pyomo_fesd.mpcc.subproblems import Stationarity


@pytest.mark.parametrize('cost, found', [(0.5 * branch_solutions.UNEVEN, True), (2 * branch_solutions.UNEVEN, False)])
def test_only_a_point_that_is_nearly_as_good_counts_with_fewer_variables_at_their_lower_bound(cost, found, monkeypatch):
    p = jump_inside_a_stage()
    point, short = p.run.point, p.compiled.neighbours[0].short
    at_bound, off = point.w.copy(), replace(point, f=point.f + cost * max(1.0, abs(point.f)))
    at_bound[short] = p.compiled.lbx[short]
    assert p.branches.neighbours.number_of_short(at_bound) == p.branches.neighbours.number_of_short(point.w) + len(short) > 0

    def certified(w, zero, enough, **options):
        return off if off.f <= enough else None

    monkeypatch.setattr(p.branches.solutions, 'certified', certified)
    monkeypatch.setattr(p.branches.solutions, 'up_to', lambda enough, suits: iter(()))
    monkeypatch.setattr(p.branches.neighbours, 'with_fewer_short', lambda point: [np.zeros(1, dtype=int)])
    assert (ShortPlaces(p.branches).fewer(replace(point, nlp=replace(point.nlp, w=at_bound))) is off) == found
    # no fewer than before
    assert ShortPlaces(p.branches).fewer(point) is None


def test_a_known_solution_with_fewer_variables_at_their_lower_bound_comes_first_unless_it_is_left_out(monkeypatch):
    p = jump_inside_a_stage()
    point, short, places = p.run.point, p.compiled.neighbours[0].short, ShortPlaces(p.branches)
    at_bound = point.w.copy()
    at_bound[short] = p.compiled.lbx[short]
    at_bound, nlps = replace(point, nlp=replace(point.nlp, w=at_bound)), len(p.kinds('branch'))
    known = places.fewer(at_bound)
    assert known.certificate.certified and known.f == pytest.approx(point.f, abs=1e-9) and len(p.kinds('branch')) == nlps
    assert p.branches.neighbours.number_of_short(known.w) == 0
    places.leave_out(known)
    # the same point, reached in another way
    again = replace(known, nlp=replace(known.nlp, w=known.w + 1e-12))
    monkeypatch.setattr(p.branches.solutions, 'up_to', lambda enough, suits: (one for one in [again] if suits(one.f, one.w)))
    assert places.fewer(at_bound) is not again


def test_no_descent_is_followed_from_a_solution_that_is_not_certified(monkeypatch):
    p = jump_inside_a_stage()
    point, short = p.run.point, p.compiled.neighbours[0].short
    at_bound = point.w.copy()
    at_bound[short] = p.compiled.lbx[short]
    other = replace(point, certificate=replace(point.certificate, grade=Stationarity.DESCENT))
    monkeypatch.setattr(p.branches.solutions, 'certified', lambda *args, **options: other)
    monkeypatch.setattr(p.branches.solutions, 'up_to', lambda enough, suits: iter(()))
    monkeypatch.setattr(p.branches.neighbours, 'with_fewer_short', lambda point: [np.zeros(1, dtype=int)])
    monkeypatch.setattr(p.branches, 'improve_from', lambda *args: pytest.fail("followed"))
    assert ShortPlaces(p.branches).fewer(replace(point, nlp=replace(point.nlp, w=at_bound))) is None
