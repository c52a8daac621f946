"""Values of expressions that may be undefined, the sign of z by declared bounds, and values that are put back."""

from math import isnan

import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.core.expr import Expr_if

from pyomo_fesd.core.evaluation import (
    kept_values,
    known_sign,
    mutable_parameters,
    number_of,
    numbers_of,
    value_or_nan,
    value_or_zero,
)


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, 2))
    m.y = pyo.Var(initialize=1)
    m.p = pyo.Param(initialize=1, mutable=True)
    return m


@pytest.mark.parametrize(
    'write, sign',
    [
        (lambda m: m.x, 1),
        (lambda m: m.x - 2, -1),
        (lambda m: m.x - 1, 0),
        (lambda m: m.x * (m.x + 1), 1),
        (lambda m: -pyo.exp(m.y), -1),
        (lambda m: m.y, 0),
        (lambda m: m.x + m.p, 0),
        (lambda m: pyo.atanh(m.x), 0),
        (lambda m: 3.0, 1),
        (lambda m: 0, 1),
    ],
)
def test_sign(m, write, sign):
    assert known_sign(write(m)) == sign


def test_fixed_values_do_not_count(m):
    m.y.fix()
    assert known_sign(m.y) == 0


@pytest.mark.parametrize('write', [lambda m: 1 / (m.x - 1), lambda m: pyo.log(-m.x), lambda m: (-m.x) ** 0.5, lambda m: m.z, None])
def test_undefined_values(m, write):
    m.x.value, m.z = 1.0, pyo.Var()
    expression = write and write(m)
    assert isnan(value_or_nan(expression)) and value_or_zero(expression) == 0.0


@pytest.mark.parametrize(
    'write',
    [
        lambda m: 3,
        lambda m: m.x,
        lambda m: m.p,
        lambda m: m.e,
        lambda m: 1.0 - m.x,
        lambda m: m.x - 2 * (m.y - m.p * m.x) / 3 - m.e,
        lambda m: -(m.x + 0.1) * (m.y + 0.2) * pyo.exp(m.x),
        lambda m: sum(0.1 * k * m.x for k in range(9)) + m.x * m.y,
    ],
)
def test_numbers_are_those_of_pyomo_to_the_last_digit(m, write):
    m.x.value, m.e = 0.3, pyo.Expression(expr=m.x**2 + m.y)
    assert number_of(write(m)) == value_or_nan(write(m)) == pyo.value(write(m))


def test_the_number_of_a_variable_without_a_value_is_refused_as_pyomo_does(m):
    for expression in (m.x, 1 - m.x):
        with pytest.raises(ValueError):
            number_of(expression)


def test_products_of_very_many_factors_have_a_number(m):
    product = m.y
    for _ in range(2000):
        product = product * m.y
    assert number_of(product) == 1.0


def test_an_infinite_value_counts_as_none_where_a_number_is_needed(m):
    assert value_or_nan(m.y + 1) == value_or_zero(m.y + 1) == 2.0
    assert value_or_nan(m.y * float('inf')) == float('inf') and value_or_zero(m.y * float('inf')) == 0.0


def test_units_are_not_mutable_parameters(m):
    assert list(mutable_parameters(m.x * pyo.units.m + m.p)) == [m.p]


def test_values_and_stale_flags_are_put_back_after_an_error(m):
    m.y.stale = True
    with pytest.raises(ZeroDivisionError), kept_values([m.x, m.y]):
        m.x.set_value(7)
        m.y.set_value(7)
        raise ZeroDivisionError
    assert (m.x.value, m.y.value, m.y.stale) == (None, 1, True)


def test_values_at_several_points():
    m = pyo.ConcreteModel()
    m.x, m.y, m.p = pyo.Var(), pyo.Var(), pyo.Param(initialize=2.0, mutable=True)
    m.e = pyo.Expression(expr=m.p * m.x**2 - m.y / 4)
    points = {id(m.x): np.array([1.0, 2.0]), id(m.y): np.array([4.0, 8.0])}
    assert numbers_of(m.e + 1, points).tolist() == [2.0, 7.0]
    assert numbers_of(1 / (m.x - 1), points) is None
    assert numbers_of(pyo.sin(m.x), points) is None
    assert numbers_of(Expr_if(m.x >= 1, m.x, m.y), points) is None
