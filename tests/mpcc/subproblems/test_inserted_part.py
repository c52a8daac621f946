"""Values that the equations of a part determine, against a simulation and against collocation by hand."""

import numpy as np
import pyomo.environ as pyo
import pytest
from problems import inserted
from problems.running import move, solve
from problems.states import over_time
from pyomo.common.timing import HierarchicalTimer

import pyomo_fesd
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.subproblems import Parts, sort_sides
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


def in_flight():
    """A block above a table: its slip goes from 1 to -1, the difference of two parts >= 0 of which nothing says the sum."""
    m = over_time(1.0, y=10.0, v=1.0, w=0.0)
    m.table = pyomo_fesd.contact(m.t, gap=lambda m, t: m.y[t], friction=0.5, slip=lambda m, t: m.v[t], sticks=True)
    m.across = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.w[t])
    m.slide = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -2 + m.table[t].friction)
    m.press = pyo.Constraint(m.t, rule=lambda m, t: m.dw[t] == -10 + m.table[t].normal)
    return solve(move(m, 2, 2))


@pytest.mark.parametrize('k', [0, 1])
def test_values_that_nothing_determines_stay_within_their_bounds(k):
    c = compile_mpcc(read_mpcc(in_flight()), HierarchicalTimer())
    parts, at = Parts(c), c.evaluate(c.x0)
    rows, own = np.flatnonzero(parts.of_row == k), parts.all[k].own
    inner = np.setdiff1d(own, [parts.all[k].extent])
    part = InsertedPart(c, sort_sides(c), parts, inner, rows, active_sets(at.G, at.H, 1e-7).zero)
    slips = {j for j in inner if c.variables[j].name.endswith(('.p', '.n'))}
    start = c.x0.copy()
    start[list(slips)] = 0.0
    found = part.solve(start, any_of=True)
    assert len(slips) >= 4 and not part.determined
    assert np.all(found[inner] >= c.lbx[inner] - 1e-9)
    assert part.missed(found) <= 1e-8
    assert part.solve(start) is None


def test_a_part_hands_on_the_forces_of_a_contact_that_must_not_slip():
    c = compile_mpcc(read_mpcc(in_flight()), HierarchicalTimer())
    parts = Parts(c)
    names = {c.variables[j].name.rsplit('.')[-1] for j in np.flatnonzero(parts.is_handed_on)}
    assert names == {'forward', 'backward'}
    of_first = parts.is_handed_on & (parts.of_variable == 0)
    among = (parts.pattern @ of_first.astype(float) > 0) & (parts.pattern @ (parts.of_variable == 1).astype(float) > 0)
    assert among.any() and set(parts.of_row[among]) == {1}
