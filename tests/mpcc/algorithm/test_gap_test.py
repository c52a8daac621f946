"""The gap test: which incumbents end a homotopy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pyomo_fesd.mpcc.algorithm.gap_test import NEARLY, TRUSTED, GapTest

ABSOLUTE, RELATIVE = 5e-7, 5e-5
values = st.floats(-1e3, 1e3)


def gap(*path):
    test = GapTest(ABSOLUTE, RELATIVE)
    for eps, f in path:
        test.add(eps, f)
    return test


@given(f=values)
def test_without_a_relaxation_nothing_is_closed(f):
    assert not gap().closed(f)


@given(f=values, relaxed=values)
def test_one_value_closes_what_is_within_the_tolerances(f, relaxed):
    assert gap((1.0, relaxed)).closed(f) == (f - relaxed <= max(ABSOLUTE, RELATIVE * abs(f)))


@given(f=values, below=st.floats(0, 1e3), eps=st.floats(1e-9, 1))
def test_an_incumbent_below_the_relaxation_is_closed(f, below, eps):
    assert gap((1.0, f), (eps, f + below)).closed(f)


@given(f=values, relaxed=values)
def test_a_gap_is_nearly_closed_by_a_part_of_the_objective_or_where_it_is_closed(f, relaxed):
    test = gap((1.0, relaxed))
    assert test.nearly_closed(f) == (test.closed(f) or f - relaxed <= NEARLY * abs(f))
    assert not gap().nearly_closed(f)


@given(f=st.floats(1, 1e3), root=st.floats(1e-6, 1e-4), eps=st.floats(1e-8, 1e-2), factor=st.floats(0.05, 0.5))
def test_a_rise_like_the_root_of_eps_is_seen_through(f, root, eps, factor):
    """f - c sqrt(eps), c sqrt(eps) below what is trusted: the value at 0 is f, which is closed, and what lies well above is not."""
    path = [(e, f - root * np.sqrt(e)) for e in (eps, eps * factor)]
    assert gap(*path).closed(f)
    assert not gap(*path).closed(f + 3 * TRUSTED * f)


def test_what_is_still_to_come_counts_up_to_what_is_trusted():
    """From 0 at eps = 1 to 0.5 at 1/4: 1 at eps = 0.  An incumbent of 1 lies in reach, but two values can mislead that much."""
    steep = gap((1.0, 0.0), (0.25, 0.5))
    assert not steep.closed(1.0)
    assert not steep.closed(0.5 * (1 + 2 * TRUSTED))
    assert steep.closed(0.5 * (1 + 0.9 * TRUSTED))


def test_the_extrapolation_uses_the_last_two_values():
    flat = gap((1.0, 0.0), (0.25, 0.5), (0.1, 0.5))
    assert not flat.closed(0.5 * (1 + 0.9 * TRUSTED))
    assert flat.closed(0.5 * (1 + 0.9 * RELATIVE))


@pytest.mark.parametrize('path', [[(0.1, 0.0), (0.1, 0.5)], [(0.1, 0.0), (1.0, 0.5)], [(1.0, 0.6), (0.1, 0.5)]])
def test_no_rise_is_read_from_an_eps_that_does_not_fall_or_an_objective_that_does(path):
    assert not gap(*path).closed(0.5 * (1 + 0.9 * TRUSTED))
    assert gap(*path).closed(0.5 * (1 + 0.9 * RELATIVE))


def test_a_restart_forgets_the_path():
    test = gap((1.0, 0.0), (0.1, 0.5))
    assert test.closed(0.5)
    test.restart()
    assert not test.closed(0.5)
    test.add(0.1, 0.2)
    assert not test.closed(0.5)
    assert test.closed(0.2)
