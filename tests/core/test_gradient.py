"""Gradients that Pyomo has, and those of functions that it does not differentiate."""

import math

import pyomo.environ as pyo
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pyomo_fesd.core import gradient

FUNCTIONS = {
    'tanh': (pyo.tanh, lambda x: 1 / math.cosh(x) ** 2),
    'sinh': (pyo.sinh, math.cosh),
    'cosh': (pyo.cosh, math.sinh),
    'asinh': (pyo.asinh, lambda x: 1 / math.sqrt(1 + x * x)),
    'sqrt': (lambda x: pyo.sqrt(x**2 + 1), lambda x: x / math.sqrt(x * x + 1)),
    'fraction': (lambda x: 3 / (2 + x**2) - 2 * x + 1, lambda x: -6 * x / (2 + x * x) ** 2 - 2),
    'step': (lambda x: pyo.Expr_if(x >= 0.123, 2 * pyo.tanh(x), 0), lambda x: 2 / math.cosh(x) ** 2 if x >= 0.123 else 0),
}


@given(st.sampled_from(sorted(FUNCTIONS)), st.floats(-3, 3), st.booleans())
def test_gradients_are_exact(name, x, through_tanh):
    m = pyo.ConcreteModel()
    m.x, m.y, m.p = pyo.Var(initialize=x), pyo.Var(initialize=2.0), pyo.Param(initialize=3.0, mutable=True)
    function, derivative = FUNCTIONS[name]
    m.e = pyo.Expression(expr=function(m.x) * m.y * m.p)
    found = gradient(m.e + (pyo.tanh(m.y) if through_tanh else 0), [m.x, m.y])
    of_y = 3 * pyo.value(function(m.x)) + (1 / math.cosh(2) ** 2 if through_tanh else 0)
    assert found == pytest.approx([6 * derivative(x), of_y], rel=1e-9, abs=1e-9)


def test_the_absolute_value_of_zero_has_a_gradient():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=0.0)
    assert gradient(3 * abs(m.x) + m.x, [m.x]) == [1.0]
