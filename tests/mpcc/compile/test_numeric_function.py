"""casadi functions of arrays."""

import casadi as ca
import numpy as np
import pytest

from pyomo_fesd.mpcc.compile.numeric_function import NumericFunction


@pytest.fixture(params=[ca.SX, ca.MX])
def function(request):
    """(x, p) -> x'x, p x, nothing."""
    x, p = request.param.sym('x', 3), request.param.sym('p')
    return NumericFunction(ca.Function('f', [x, p], [ca.dot(x, x), p * x, request.param(0, 1)]))


def test_results_are_arrays(function):
    square, product, nothing = function(np.array([1.0, 2.0, 3.0]), [0.5])
    np.testing.assert_array_equal(square, [14.0])
    np.testing.assert_array_equal(product, [0.5, 1.0, 1.5])
    assert nothing.size == 0


def test_results_of_two_calls_are_different_arrays(function):
    first = function(np.ones(3), [1.0])[1]
    second = function(np.ones(3), [2.0])[1]
    np.testing.assert_array_equal(first, np.ones(3))
    np.testing.assert_array_equal(second, 2 * np.ones(3))


def test_every_second_element_of_an_array(function):
    np.testing.assert_array_equal(function(np.arange(6.0)[::2], [1.0])[1], [0.0, 2.0, 4.0])


def test_a_wrong_length_is_refused(function):
    with pytest.raises(ValueError, match="argument 0 has 2 elements, not 3"):
        function(np.ones(2), [1.0])
