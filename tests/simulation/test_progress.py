"""Intervals that shrink geometrically."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pyomo_fesd.simulation.progress import accumulation


def shrinking(ratio, number, name='a', first=1.0):
    """Events whose intervals are first, first ratio, ..."""
    times, gap = [0.0], first
    for _ in range(number):
        times.append(times[-1] + gap)
        gap *= ratio
    return [(t, name) for t in times]


@given(ratio=st.floats(0.1, 0.9), number=st.integers(4, 12))
def test_the_limit_of_a_geometric_series(ratio, number):
    times, limit = accumulation(shrinking(ratio, number))
    assert limit == pytest.approx(1 / (1 - ratio))
    assert times == [t for t, _ in shrinking(ratio, number)][-4:]


def test_intervals_that_grow_or_stay_have_none():
    assert accumulation(shrinking(1.0, 9)) is None
    assert accumulation(shrinking(1.5, 9)) is None
    assert accumulation(shrinking(0.99, 9)) is None


def test_a_few_events_do_not_accumulate():
    assert accumulation([]) is None
    assert accumulation(shrinking(0.5, 3)) is None


def test_each_name_counts_by_itself():
    mixed = sorted([*shrinking(0.5, 6, 'ball'), *shrinking(1.0, 3, 'clock')])
    times, limit = accumulation(mixed)
    assert limit == pytest.approx(2.0)


def test_events_at_the_same_time_do_not_divide_by_zero():
    assert accumulation([(1.0, 'a')] * 6) is None
