"""Values that the equations of a part determine, against a simulation and against collocation by hand."""

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import inserted

from pyomo_fesd.mpcc.subproblems.active_set import active_sets
from pyomo_fesd.mpcc.subproblems.inserted_part import InsertedPart


def equations(s, k, zero):
    part = s.parts.all[k]
    inner = np.setdiff1d(part.own, [part.extent])
    return inner, InsertedPart(s.c, s.sides, s.parts, inner, np.flatnonzero(s.parts.of_row == k), zero)


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize('k', [1, 2, 3])
def test_the_equations_of_a_simulated_part_give_back_its_values(k, form):
    s = inserted.simulated(5, form)
    inner, part = equations(s, k, s.zero)
    start, random = s.w.copy(), np.random.default_rng(k)
    start[inner] += random.uniform(-0.05, 0.05, len(inner))
    found = part.solve(start)
    kept = inner[~s.parts.is_gate[inner]]
    assert found[kept] == pytest.approx(s.w[kept], abs=1e-7)
    assert np.array_equal(np.delete(found, inner), np.delete(start, inner))


@pytest.mark.parametrize('extent', [1e-1, 1e-3])
def test_at_another_extent_they_are_those_of_collocation(extent):
    s = inserted.simulated(5, 'heaviside')
    inner, part = equations(s, 1, s.zero)
    start = s.w.copy()
    start[s.parts.all[1].extent] = extent
    found = part.solve(start)
    first, last = s.parts.all[1].first, s.parts.all[1].last
    states = [j for j, v in enumerate(s.c.variables[i] for i in first) if v.parent_component() is s.m.x]
    x, modes = start[first[states]], [pyo.value(s.m.s[s.inside[1], i]) for i in s.m.i]
    assert found[last[states]] == pytest.approx(inserted.radau(x, modes, s.m.theta.value, extent), abs=1e-8)


def test_the_values_at_other_sides_miss_bounds():
    s = inserted.simulated(5, 'heaviside')
    _, part = equations(s, 1, s.zero)
    assert not part.contradict(s.w)
    # the other side of each pair of the part
    other = np.where(s.parts.of_pair == 1, 1 - s.zero, s.zero)
    _, part = equations(s, 1, other)
    assert part.solve(s.w) is None or np.any(part.solve(s.w) < s.c.lbx - 1e-3)


def test_active_sets_of_the_simulation_are_clear():
    s = inserted.simulated(5, 'stewart')
    at = s.c.evaluate(s.w)
    assert not active_sets(at.G, at.H, 1e-7).gamma[s.parts.of_pair == 1].any()
