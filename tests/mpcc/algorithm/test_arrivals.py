"""Changes at an end of a row of places come in one place further in."""

from types import SimpleNamespace

import numpy as np
import pytest

from pyomo_fesd.mpcc.algorithm.arrivals import branches
from pyomo_fesd.mpcc.compile.hint_indices import ArrivalIndices, MoveIndices, OptionIndices, PlaceIndices, ToggleIndices
from pyomo_fesd.mpcc.subproblems import G_ZERO, H_ZERO, ActiveSets

NONE = np.zeros(0, dtype=int)
STILL = MoveIndices(NONE, NONE, NONE)


def moves(targets, sources):
    return MoveIndices(np.array(targets), np.array(sources), NONE)


def row(number):
    """Places 0, 1, ... from the end inwards, each with the pairs 2n and 2n + 1 and the extent n."""
    inner = (PlaceIndices(n, moves([2 * n, 2 * n + 1], [2 * n - 2, 2 * n - 1]), STILL, NONE) for n in range(1, number))
    return (PlaceIndices(0, STILL, STILL, NONE), *inner)


def toggles(*gauges):
    return tuple(ToggleIndices(np.array([pair]), None, gauge, NONE, NONE) for pair, gauge in enumerate(gauges))


def both(arrivals, zero, gauges, extents, settled=np.copy):
    """The branches, each with the changed end and the system that changes alone."""
    compiled = SimpleNamespace(arrivals=arrivals, measured=lambda w: np.array(gauges, dtype=float))
    zero = np.array(zero)
    sets = ActiveSets(zero, np.zeros(len(zero), dtype=bool))
    return list(branches(compiled, np.array(extents, dtype=float), sets, 1e-6, settled))


def found(*given, **more):
    return [entered for entered, *_ in both(*given, **more)]


ONE_MODE = [G_ZERO, H_ZERO]
OTHER_MODE = [H_ZERO, G_ZERO]
BOTH = [H_ZERO, H_ZERO]


def test_a_surface_at_the_end_leads_to_the_other_mode_or_onto_it():
    (onto, beyond) = found([ArrivalIndices((row(2),), toggles(0, 1), ())], ONE_MODE * 2, [0, 0], [1, 1])
    for entered, mode in ((onto, BOTH), (beyond, OTHER_MODE)):
        assert entered.zero.tolist() == [*mode, *ONE_MODE] and entered.extents.tolist() == [0]
        assert entered.start.tolist() == [0, 2]


def test_sides_that_other_pairs_make_superfluous_are_no_change():
    def settled(zero):
        # pair 1 of the place at the end makes pair 0 hold
        return np.array([G_ZERO if zero[1] == H_ZERO else zero[0], *zero[1:]])

    given = [ArrivalIndices((row(2),), toggles(0, 1), ())], ONE_MODE * 2, [0, 0], [1, 1]
    (beyond,) = found(*given, settled=settled)
    assert beyond.zero.tolist() == [*OTHER_MODE, *ONE_MODE]


def test_a_surface_elsewhere_leads_nowhere():
    assert found([ArrivalIndices((row(2),), toggles(0, 1), ())], ONE_MODE * 2, [1e-3, 0], [1, 1]) == []


def test_modes_move_inwards_up_to_the_first_equal_ones():
    zero = [*ONE_MODE, *OTHER_MODE, *OTHER_MODE, *ONE_MODE]
    _, entered = found([ArrivalIndices((row(4),), toggles(0, 1), ())], zero, [0, 0], [0.1, 0.2, 0.3, 0.4])
    assert entered.zero.tolist() == [*OTHER_MODE, *ONE_MODE, *OTHER_MODE, *ONE_MODE]
    assert entered.start.tolist() == pytest.approx([0, 0.1, 0.5, 0.4])


def test_without_a_place_to_spare_the_order_is_open():
    arrival = ArrivalIndices((row(2),), toggles(0, 1), ())
    assert found([arrival], [*ONE_MODE, *OTHER_MODE], [0, 0], [1, 1]) == [None, None]


def test_the_place_at_the_end_alone_needs_no_place_to_spare():
    arrival = ArrivalIndices((row(2),), toggles(0, 1), ())
    for (_, changed, _), mode in zip(both([arrival], [*ONE_MODE, *OTHER_MODE], [0, 0], [1, 1]), (BOTH, OTHER_MODE), strict=True):
        assert (changed.extent, changed.inner) == (0, 1) and changed.zero.tolist() == [*mode, *OTHER_MODE]
        assert (changed.targets.tolist(), changed.sources.tolist()) == ([2, 3], [0, 1])


def test_the_place_at_the_end_alone_is_none_between_two_rows():
    zero, arrival = ONE_MODE * 4, ArrivalIndices((row(2), row(2)), toggles(0, 1), ())
    assert all(changed is None for _, changed, _ in both([arrival], zero, [0, 0], [1, 1]))


def test_an_event_between_equal_modes_is_no_place_to_spare():
    happening = [OTHER_MODE[0]]  # the pair 4 between both places, its second side zero
    end, inner = row(2)
    inner = PlaceIndices(inner.extent, inner.inside, inner.between, np.array([4]))
    arrival = [ArrivalIndices(((end, inner),), toggles(0, 1), ())]
    assert found(arrival, ONE_MODE * 2 + happening, [0, 0], [1, 1]) == [None, None]
    assert None not in found(arrival, [*ONE_MODE * 2, G_ZERO], [0, 0], [1, 1])


def test_an_option_needs_its_mode_and_its_gauge():
    option = OptionIndices(np.array([0]), np.array([0]), np.array([G_ZERO]), np.array([0, 1]), np.array(OTHER_MODE), np.array([3]))
    arrival = [ArrivalIndices((row(2),), (), (option,))]
    (entered,) = found(arrival, ONE_MODE * 2, [0], [1, 1])
    assert entered.zero.tolist() == [*OTHER_MODE, *ONE_MODE] and entered.either.tolist() == [3]
    assert found(arrival, OTHER_MODE * 2, [0], [1, 1]) == found(arrival, ONE_MODE * 2, [1], [1, 1]) == []


def test_two_systems_alone_together_and_in_both_orders():
    # the second system has the pair 6 at the end, 7 and 8 in the next places
    rest = (PlaceIndices(n, moves([2 * n, 2 * n + 1, 6 + n], [2 * n - 2, 2 * n - 1, 5 + n]), STILL, NONE) for n in (1, 2))
    rows = ((row(1)[0], *rest),)
    systems = [ArrivalIndices(rows, (ToggleIndices(np.array([pair]), None, k, NONE, NONE),), ()) for k, pair in ((0, 0), (1, 6))]
    orders = found(systems, [G_ZERO] * 9, [0, 0], [1, 1, 1])
    alone = [one for *_, one in both(systems, [G_ZERO] * 9, [0, 0], [1, 1, 1])]
    assert alone[0] != alone[1] and None not in alone[:2] and not any(alone[2:])
    ends = [(entered.zero[[0, 2]].tolist(), entered.zero[[6, 7]].tolist(), entered.extents.tolist()) for entered in orders]
    on, off = [H_ZERO, G_ZERO], [G_ZERO, G_ZERO]
    assert ends[:3] == [(on, off, [0]), (off, on, [0]), (on, on, [0])]
    # what comes in first lies further in, and the place at the end has both
    assert [extents for *_, extents in ends[3:]] == [[0, 1], [0, 1]]
    assert ends[3][:2] == ([H_ZERO, H_ZERO], on) and ends[4][:2] == (on, [H_ZERO, H_ZERO])


def test_a_touched_end_between_two_rows_needs_a_place_on_both_sides():
    right = PlaceIndices(2, STILL, STILL, NONE), PlaceIndices(3, moves([6, 7], [4, 5]), STILL, NONE)
    on_both = tuple(ToggleIndices(np.array([pair, pair + 4]), None, gauge, NONE, NONE) for pair, gauge in ((0, 0), (1, 1)))
    _, entered = found([ArrivalIndices((row(2), right), on_both, ())], ONE_MODE * 4, [0, 0], [1] * 4)
    assert entered.extents.tolist() == [0, 2] and entered.start.tolist() == [0, 2, 0, 2]
    assert entered.zero.tolist() == [*OTHER_MODE, *ONE_MODE, *OTHER_MODE, *ONE_MODE]
    # a side that has changed already is a coincidence
    assert found([ArrivalIndices((row(2), right), on_both, ())], ONE_MODE * 2 + OTHER_MODE * 2, [0, 0], [1] * 4) == []
