"""Verdicts of LPECs and of several copies."""

from types import SimpleNamespace

import numpy as np
import pytest

from pyomo_fesd.mpcc.subproblems import Verdict
from pyomo_fesd.mpcc.subproblems.verdict import charge, of_all, of_growth, of_orders


def lpec(slope, solved=True):
    """An LPEC with one variable, which may grow by 1 with this slope, at a cost of each unit."""

    def best(credits):
        (credit,) = credits
        grown = float(slope + credit < 0.0)
        value = min(slope + credit, 0.0)
        return SimpleNamespace(solved=solved, value=value, descent=-value, d=np.array([grown]))

    return best


def unchanged(slope):
    return lambda: [charge(lpec(slope)([0.0]), 0, 1e-6)]


@pytest.mark.parametrize(
    'slope, solved, verdict',
    [
        (-1e-7, True, Verdict.NO_DESCENT),
        (-1e-5, True, Verdict.DESCENT),
        (1.0, True, Verdict.NO_DESCENT),
        (0.0, False, Verdict.UNKNOWN),
    ],
)
def test_an_lpec_decides_if_it_was_solved(slope, solved, verdict):
    assert of_growth(lpec(slope, solved), unchanged(0.0), 1e-6) is verdict


@pytest.mark.parametrize('slope, verdict', [(-1e-3, Verdict.NO_DESCENT), (-2e-3, Verdict.DESCENT)])
def test_descent_of_a_part_that_changes_nothing_does_not_count(slope, verdict):
    assert of_growth(lpec(slope), unchanged(-1e-3), 1e-6) is verdict


def test_where_nothing_is_known_of_an_unchanged_part_all_descent_counts():
    assert of_growth(lpec(-1e-3), lambda: [charge(None, 0, 1e-6)], 1e-6) is Verdict.DESCENT


def test_without_an_lpec_nothing_is_decided():
    assert of_growth(lambda credit: None, unchanged(0.0), 1e-6) is Verdict.UNKNOWN


def test_copies_show_no_descent_only_if_all_of_them_do():
    none, descent, unknown, impossible = Verdict.NO_DESCENT, Verdict.DESCENT, Verdict.UNKNOWN, Verdict.IMPOSSIBLE
    assert of_all([none, none]) is none
    assert of_all([none, unknown]) is unknown
    assert of_all([unknown, descent]) is descent
    assert of_all([none, impossible]) is impossible


def test_orders_are_excluded_only_together():
    none, descent, unknown, impossible = Verdict.NO_DESCENT, Verdict.DESCENT, Verdict.UNKNOWN, Verdict.IMPOSSIBLE
    assert of_orders([impossible, impossible]) is impossible
    assert of_orders([impossible, none]) is none
    assert of_orders([none, unknown]) is unknown
    assert of_orders([unknown, descent, impossible]) is descent
    assert of_orders([descent, Verdict.NONE]) is Verdict.NONE
