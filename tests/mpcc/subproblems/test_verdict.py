"""Verdicts of LPECs and of several copies."""

from types import SimpleNamespace

import pytest

from pyomo_fesd.mpcc.subproblems import Verdict
from pyomo_fesd.mpcc.subproblems.verdict import of_all, of_lpec


@pytest.mark.parametrize(
    'solved, descent, verdict', [(True, 1e-7, Verdict.NO_DESCENT), (True, 1e-5, Verdict.DESCENT), (False, 0.0, Verdict.UNKNOWN)]
)
def test_an_lpec_decides_if_it_was_solved(solved, descent, verdict):
    assert of_lpec(SimpleNamespace(solved=solved, descent=descent), 1e-6) is verdict


def test_without_an_lpec_nothing_is_decided():
    assert of_lpec(None, 1e-6) is Verdict.UNKNOWN


def test_copies_show_no_descent_only_if_all_of_them_do():
    none, descent, unknown, impossible = Verdict.NO_DESCENT, Verdict.DESCENT, Verdict.UNKNOWN, Verdict.IMPOSSIBLE
    assert of_all([none, none]) is none
    assert of_all([none, unknown]) is unknown
    assert of_all([unknown, descent]) is descent
    assert of_all([none, impossible]) is impossible
