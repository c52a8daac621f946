"""Sides that other pairs decide: they are neither imposed by a row nor left to a binary."""

from itertools import product

import numpy as np
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import certify
from pyomo_fesd.core import Follower, homotopy_hints
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.subproblems.active_set import FREE, G_ZERO, H_ZERO, active_sets
from pyomo_fesd.mpcc.subproblems.lpec import Lpec
from pyomo_fesd.mpcc.subproblems.side_constraints import settle, sort_sides


def decided():
    """0 <= a (1 - b) perp x - 1 >= 0 with a and b either 0 or 1; x wants to grow."""
    m = pyo.ConcreteModel()
    m.a, m.b = pyo.Var(bounds=(0, 1), initialize=1), pyo.Var(bounds=(0, 1), initialize=1)
    m.x = pyo.Var(initialize=1)
    m.one = Complementarity(expr=complements(m.a >= 0, 1 - m.a >= 0))
    m.two = Complementarity(expr=complements(m.b >= 0, 1 - m.b >= 0))
    m.pair = Complementarity(expr=complements(m.a * (1 - m.b) >= 0, m.x - 1 >= 0))
    m.far = pyo.Objective(expr=-m.x)
    return m


def compiled(m):
    c = compile_mpcc(read_mpcc(m), HierarchicalTimer())
    return c, sort_sides(c)


def position(c, name):
    return next(k for k, condition in enumerate(c.conditions) if condition.name == name)


@pytest.mark.parametrize('a, b, chosen', list(product([0, 1], [0, 1], [G_ZERO, H_ZERO])))
def test_a_side_that_other_pairs_make_zero_is_chosen(a, b, chosen):
    c, sides = compiled(decided())
    zero = np.zeros(3, dtype=int)
    for name, choice in (('one', H_ZERO if a else G_ZERO), ('two', H_ZERO if b else G_ZERO), ('pair', chosen)):
        zero[position(c, name)] = choice
    settled = settle(c, sides, c.x0, zero)
    # x is free unless a = 1 and b = 0; a contradiction stays one
    assert settled[position(c, 'pair')] == (chosen if a and not b else G_ZERO)
    others = [position(c, 'one'), position(c, 'two')]
    assert list(settled[others]) == list(zero[others])


def test_a_pair_that_is_left_open_stays_open():
    c, sides = compiled(decided())
    zero = np.full(3, FREE)
    for name in ('one', 'two'):
        zero[position(c, name)] = H_ZERO
    assert settle(c, sides, c.x0, zero)[position(c, 'pair')] == FREE


def test_a_side_that_cannot_move_needs_no_binary():
    c, sides = compiled(decided())
    at = c.evaluate(c.x0)
    sets = active_sets(at.G, at.H, 1e-6)
    assert np.count_nonzero(sets.gamma) == 1
    step = Lpec(c, sides, {}).solve(c.x0, sets, 1.0)
    assert step.binaries == 0 and step.value == pytest.approx(-1)
    assert step.zero[position(c, 'pair')] == G_ZERO


@pytest.mark.parametrize('swapped', [False, True])
def test_a_follower_has_the_side_of_its_leader(swapped):
    m = pyo.ConcreteModel()
    m.a, m.b, m.x, m.y = (pyo.Var(bounds=(0, 1), initialize=0.5) for _ in range(4))
    m.leader = Complementarity(expr=complements(m.a >= 0, m.x >= 0))
    m.follower = Complementarity(expr=complements(m.x >= 0, m.b >= 0) if swapped else complements(m.b >= 0, m.x >= 0))
    m.far = pyo.Objective(expr=-m.x)
    homotopy_hints(m).followers.append(Follower(m.follower, m.leader, swapped))
    m.a.value, m.x.value = 0, 0
    c, sides = compiled(m)
    leader, follower = position(c, 'leader'), position(c, 'follower')
    for side in (G_ZERO, H_ZERO, FREE):
        for own in (G_ZERO, H_ZERO):
            zero = np.full(2, own)
            zero[leader] = side
            assert settle(c, sides, c.x0, zero)[follower] == (side if side == FREE else side ^ swapped)
    # b = 0.5 would tie x to 0, but may follow a, which is 0
    m.x.value, m.a.value = 1e-3, 0
    c, sides = compiled(m)
    at = c.evaluate(c.x0)
    step = Lpec(c, sides, {}).solve(c.x0, active_sets(at.G, at.H, 1e-6), 0.1)
    assert step.value == pytest.approx(-0.1)
    assert certify(m, feasibility_tol=1e-2).grade.name == 'DESCENT'
    assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B' and m.x.value == pytest.approx(1)


@settings(deadline=None)
@given(
    factors=st.lists(st.integers(0, 4), min_size=3, max_size=12),
    choices=st.lists(st.sampled_from([G_ZERO, H_ZERO]), min_size=11, max_size=11),
)
def test_a_settled_branch_contains_the_branch(factors, choices):
    """Whatever is feasible in a branch is so in the settled one; settling again changes nothing."""
    m = pyo.ConcreteModel()
    m.i, m.k = pyo.RangeSet(5), pyo.RangeSet(len(factors) // 2)
    m.a, m.x = pyo.Var(m.i, bounds=(0, 1), initialize=0.3), pyo.Var(m.k, initialize=0.7)
    m.binary = Complementarity(m.i, rule=lambda m, i: complements(m.a[i] >= 0, 1 - m.a[i] >= 0))
    m.pair = Complementarity(
        m.k, rule=lambda m, k: complements(m.a[factors[2 * k - 2] + 1] * (1 - m.a[factors[2 * k - 1] + 1]) >= 0, m.x[k] >= 0)
    )
    m.cost = pyo.Objective(expr=sum(m.x[k] for k in m.k))
    c, sides = compiled(m)
    zero = np.array(choices[: c.G.numel()])
    settled = settle(c, sides, c.x0, zero)
    assert np.array_equal(settle(c, sides, c.x0, settled), settled)
    lower, upper = sides.bounds(zero, c.lbx, c.ubx)
    if np.any(lower > upper):
        assert np.array_equal(settled, zero)
        return
    # a feasible point of the branch, if it has one
    w = np.where(lower == upper, lower, np.clip(c.x0, lower, upper))
    at = c.evaluate(w)
    new = settled != zero
    assert np.all(np.where(settled == G_ZERO, at.G, at.H)[new] == 0)


@settings(deadline=None)
@given(
    terms=st.lists(st.sets(st.integers(0, 3), min_size=1, max_size=3), min_size=4, max_size=10),
    choices=st.lists(st.sampled_from([G_ZERO, H_ZERO]), min_size=5, max_size=5),
)
def test_no_pair_takes_away_room_that_sums_of_others_have_settled(terms, choices):
    """The sides are sums of variables >= 0: a settled branch fixes no more variables, and its pairs hold."""
    m = pyo.ConcreteModel()
    m.a, m.k = pyo.Var(range(4), bounds=(0, 1), initialize=0.3), pyo.RangeSet(len(terms) // 2)
    m.pair = Complementarity(m.k, rule=lambda m, k: complements(*(sum(m.a[i] for i in terms[2 * k - s]) >= 0 for s in (2, 1))))
    m.cost = pyo.Objective(expr=-sum(m.a.values()))
    c, sides = compiled(m)
    zero = np.array(choices[: c.pairs])
    settled = settle(c, sides, c.x0, zero)
    of_branch, of_settled = (sides.bounds(some, c.lbx, c.ubx)[1] == 0 for some in (zero, settled))
    assert np.all(of_settled <= of_branch)
    w = np.where(of_settled, 0.0, 1.0)
    at = c.evaluate(w)
    assert np.all(np.minimum(at.G, at.H) == 0)
