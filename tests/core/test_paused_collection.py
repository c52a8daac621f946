"""Many objects are made without a garbage collection, and none follows."""

import gc
from contextlib import contextmanager

import pytest

from pyomo_fesd.core import paused_collection
from pyomo_fesd.core.paused_collection import FEW, MOST


@pytest.fixture(autouse=True)
def enabled_afterwards():
    gc.enable()
    gc.collect()
    yield
    gc.unfreeze()
    gc.enable()


def cycles(number):
    """Garbage that only a collection finds, as models are: two objects each."""
    for _ in range(number):
        one = []
        one.append([one])


@contextmanager
def collections():
    """The list of the generations that are collected in the body."""
    found = []

    def note(phase, info):
        found.extend([info['generation']] * (phase == 'start'))

    gc.callbacks.append(note)
    try:
        yield found
    finally:
        gc.callbacks.remove(note)


def make(number):
    """Make some objects in a paused collection, and a few after it."""
    with paused_collection():
        made = [[] for _ in range(number)]
    made += [[] for _ in range(100)]
    return made


def test_no_collection_starts_inside_or_because_of_the_new_objects():
    with collections() as found:
        make(2 * FEW)
    assert not found


def test_few_objects_stay_young():
    with collections() as found:
        make(FEW // 2)
    assert found == [0]


def test_garbage_made_inside_is_found_by_a_full_collection():
    with paused_collection():
        cycles(FEW)
    assert gc.collect(1) < FEW and gc.collect() >= 2 * FEW - 10


def test_objects_that_were_thrown_away_do_not_add_up():
    with collections() as found:
        for _ in range(4):
            with paused_collection():
                cycles(MOST // 4)
        cycles(1)
        make(1000)
    assert found


def test_a_full_collection_allows_as_many_again():
    for _ in range(2):
        make(MOST + FEW)
        gc.collect()
    with collections() as found:
        make(2 * FEW)
    assert not found


def test_an_error_leaves_the_new_objects_young():
    with collections() as found:
        with pytest.raises(ZeroDivisionError), paused_collection():
            cycles(FEW)
            raise ZeroDivisionError
        cycles(1000)
    assert gc.isenabled() and found


def test_a_collection_that_is_off_stays_off():
    gc.disable()
    with paused_collection():
        assert not gc.isenabled()
        cycles(FEW)
    assert not gc.isenabled() and gc.get_count()[0] > FEW


def test_what_somebody_froze_stays_frozen():
    gc.freeze()
    frozen = gc.get_freeze_count()
    make(2 * FEW)
    assert frozen and gc.get_freeze_count() >= frozen - 100


def test_inner_pauses_leave_it_to_the_outer_one():
    with paused_collection():
        with paused_collection():
            pass
        assert not gc.isenabled()
    assert gc.isenabled()
