"""The limit of a copy, and whether its bounds hold there, against the rates and regions by hand."""

import numpy as np
import pytest
from problems import inserted

from pyomo_fesd.mpcc.subproblems.inserted_copy import Copy, Insertion


def copy_of(s, k, source, ahead=False):
    """The copy of part ``k`` after it, or ahead of it, with the sides of part ``source``."""
    zero = s.zero.copy()
    zero[s.parts.of_pair == k] = s.zero[s.parts.of_pair == source]
    return Copy(s.c, s.sides, s.parts, Insertion(k, ahead, zero, s.zero, (k, source)))


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize('k', [1, 2])
def test_the_limit_has_the_rates_at_the_end_of_the_part_before(k, form):
    s = inserted.simulated(5, form)
    copy = copy_of(s, k, k)
    assert copy.solve(s.w, (k,)) and not copy.impossible(s.w)
    part, at = s.parts.all[k], dict(zip(s.names, copy.limit))
    ends = [s.c.variables[j] for j in part.last]
    states = [v for v in ends if v.parent_component() is s.m.x]
    x = [s.w[s.names.index(v.name)] for v in states]
    assert [at[v.name] for v in states] == pytest.approx(x, abs=1e-5) and at[s.names[part.extent]] == 0
    modes = [at[s.m.s[v.index()].name] for v in states]
    rates = [at[s.m.dx[v.index()].name] for v in states]
    assert rates == pytest.approx(inserted.rate(x, modes, s.m.theta.value), abs=1e-4)


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
def test_a_mode_is_possible_where_its_region_is_near_and_nowhere_else(form):
    s = inserted.simulated(5, form)
    theta = s.m.theta.value
    modes = [tuple(round(s.m.s[t, i].value) for i in s.m.i) for t in s.inside]
    tried = set()
    for k in range(1, 3):
        end = s.m.t.at(s.m.t.ord(s.inside[k]) + 1)
        x = [s.m.x[end, i].value for i in s.m.i]
        for source in range(1, 4):
            copy = copy_of(s, k, source)
            possible = copy.solve(s.w, (k, source)) and not copy.impossible(s.w)
            distances = [(x[i - 1] - i * theta) * (1 if mode else -1) for i, mode in zip(s.m.i, modes[source])]
            assert possible == (min(distances) > -1e-6)
            tried.add(possible)
    assert tried == {True, False}


def test_a_copy_at_its_limit_misses_no_row():
    s = inserted.simulated(5, 'heaviside')
    copy = copy_of(s, 1, 1)
    assert copy.solve(s.w, (1,))
    low, high, lower, upper, _ = copy.limits(1.0)
    assert np.all(low <= 0) and np.all(high >= 0) and np.all(lower <= 0) and np.all(upper >= 0)
