"""Weights of linear functionals of polynomials."""

import pytest

from pyomo_fesd.core.interpolation import interpolation_weights

NODES = (0.1, 0.4, 0.9)


@pytest.mark.parametrize(
    'moments, exact',
    [
        ((1, 1, 1), 2 - 3 + 5),  # value at 1
        ((0, 0, 1), 5),  # leading coefficient
        ((0, 1, 0), -3),  # derivative at 0
        ((1, 1 / 2, 1 / 3), 2 - 3 / 2 + 5 / 3),  # integral over [0, 1]
    ],
)
def test_functionals_of_a_parabola(moments, exact):
    values = [2 - 3 * t + 5 * t**2 for t in NODES]
    assert interpolation_weights(NODES, moments) @ values == pytest.approx(exact)
