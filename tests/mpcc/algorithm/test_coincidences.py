"""Orders whose branch has another solution than the incumbent."""

from dataclasses import replace

import numpy as np
import pytest
from problems import carried
from problems.parts import parts

from pyomo_fesd.mpcc.algorithm.arrivals import Entered
from pyomo_fesd.mpcc.algorithm.coincidences import OPEN, Coincidences

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
    assert coincidences._try(point, False, way) is (found if better else OPEN) and seen == [True]
    # with places that can be inserted the branch is tried before, from the point as it is
    del seen[:]
    assert coincidences._try(point, True, way) is (found if better else OPEN) and seen == [True] * (1 if better else 2)
