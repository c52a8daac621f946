"""Sum-up rounding keeps its bound, and refuses what are no fractions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyomo_fesd import FesdError, sum_up_rounding


def test_by_hand():
    found = sum_up_rounding([[0.6, 0.4], [0.6, 0.4], [0.6, 0.4]], [1.0, 1.0, 2.0])
    # ahead: (0.6, 0.4); (0.2, 0.8); (1.4, 0.6)
    assert found.modes.tolist() == [0, 1, 0] and found.weights.tolist() == [[1, 0], [0, 1], [1, 0]]
    assert found.deviation == pytest.approx(0.6) and found.bound == 2.0


@settings(max_examples=200, deadline=None)
@given(st.integers(1, 40), st.integers(2, 6), st.integers(0, 10**6))
def test_the_integrals_stay_within_the_bound(stages, modes, seed):
    random = np.random.default_rng(seed)
    fractions, lengths = random.dirichlet(np.full(modes, 0.3), stages), random.uniform(0.01, 2.0, stages)
    found = sum_up_rounding(fractions, lengths)
    difference = np.cumsum((fractions - found.weights) * lengths[:, None], axis=0)
    assert found.deviation == pytest.approx(np.abs(difference).max(), abs=1e-12)
    assert found.deviation <= found.bound + 1e-12 and found.bound == (modes - 1) * lengths.max()
    assert (found.weights.sum(axis=1) == 1).all() and (found.weights.argmax(axis=1) == found.modes).all()


def test_integers_stay():
    weights = np.eye(3, dtype=int)[[2, 0, 1, 1]]
    found = sum_up_rounding(weights)
    assert (found.weights == weights).all() and found.deviation == 0


@pytest.mark.parametrize(
    'fractions, lengths, cause',
    [
        ([0.5, 0.5], None, 'shape'),
        ([[0.5, 0.6]], None, 'stage 0'),
        ([[0.5, 0.5], [1.2, -0.2]], None, 'stage 1'),
        ([[0.5, 0.5]], [1.0, 1.0], 'lengths'),
        ([[0.5, 0.5]], [0.0], 'lengths'),
        ([[float('nan'), 0.5]], None, 'stage 0'),
    ],
)
def test_refuses(fractions, lengths, cause):
    with pytest.raises(FesdError, match=cause):
        sum_up_rounding(fractions, lengths)
