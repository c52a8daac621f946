"""Where polynomials on an element fall below zero."""

import numpy as np
import pytest

from pyomo_fesd.simulation.element_signs import BETWEEN, _first_fall, _real_roots, _rises_first, _values_of_polynomials

RADAU_3 = np.array([0.0, 0.1550510257216822, 0.6449489742783178, 1.0])


@pytest.mark.parametrize('leading', [0.0, 3e-15, -3e-15, 1e-17])
def test_a_leading_coefficient_of_round_off_moves_no_root(leading):
    polynomial = np.polynomial.Polynomial([0.02, -0.3, 1.0, leading])
    assert _real_roots(polynomial) == pytest.approx([0.1, 0.2], abs=1e-12)


@pytest.mark.parametrize('h', [0.5, 1.0, 1.5335414030478454, 3.0])
def test_a_parabola_that_rises_before_the_first_point(h):
    row = 0.0447 * RADAU_3 * h - (RADAU_3 * h) ** 2 / 2
    polynomial = np.polynomial.Polynomial.fit(RADAU_3, row, 3, domain=[0, 1], window=[0, 1])
    assert _rises_first(polynomial, RADAU_3, row)
    assert _first_fall(polynomial, RADAU_3, row) == pytest.approx(2 * 0.0447 / h, abs=1e-10)


@pytest.mark.parametrize('count', [1, 2, 4])
def test_lagrange_polynomials_interpolate(count):
    nodes = np.linspace(0.2, 1.0, count)
    assert nodes ** (count - 1) @ _values_of_polynomials(nodes, BETWEEN) == pytest.approx(BETWEEN ** (count - 1), abs=1e-12)
