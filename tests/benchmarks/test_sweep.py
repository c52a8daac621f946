"""The study of 1,000 scenarios: the one whose answer is wrong is warned of, and the warning reaches the row."""

import pytest
from benchmarks.sweep.run import MISSED
from benchmarks.sweep.scenarios import OUTPUTS, build, reference, table

import pyomo_fesd

MISSES, AGREES = 630, 0


@pytest.mark.parametrize('number', [MISSES, AGREES])
def test_a_missed_crossing_is_in_the_row(number):
    (row,) = pyomo_fesd.sweep(build, table().loc[[number]], OUTPUTS, progress=False).to_dict('records')
    exact = reference(**table().loc[number])
    assert row['certified']
    assert (row['switches'] == exact['switches']) is (number == AGREES)
    assert (MISSED in row['warnings']) is (number == MISSES)
