"""Expressions with equal structural keys."""

import pyomo.environ as pyo
import pytest

from pyomo_fesd.core import StructuralKey, any_number


def model():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(4))
    m.p = pyo.Param(range(2), initialize={0: 2.0, 1: 3.0}, mutable=True)
    m.e = pyo.Expression(expr=m.x[0] ** 2)
    return m


def key(expr, **keywords):
    found = StructuralKey()
    found.append(expr, **keywords)
    return found


@pytest.mark.parametrize(
    'one, other, same',
    [
        (lambda m: m.x[0] + 2 * m.x[1] == 1, lambda m: m.x[2] + 2 * m.x[3] == 1, True),
        (lambda m: m.x[0] * m.x[1], lambda m: m.x[2] * m.x[2], False),
        (lambda m: m.x[0] + 2 * m.x[1] == 1, lambda m: m.x[2] + 3 * m.x[3] == 1, False),
        (lambda m: pyo.exp(m.x[0]), lambda m: pyo.log(m.x[0]), False),
        (lambda m: m.p[0] * m.x[0], lambda m: m.p[1] * m.x[0], False),
        (lambda m: (1 + 1e-12) * m.x[0], lambda m: 1.0 * m.x[0] + 0 * m.x[1], False),
        (lambda m: 2 * (1 + 1e-12) * m.x[0], lambda m: 2 * m.x[1], True),
    ],
)
def test_structure_numbers_and_places_of_variables_count(one, other, same):
    m = model()
    assert (key(one(m)).tokens == key(other(m)).tokens) is same


def test_named_expressions_are_seen_through():
    m = model()
    assert key(m.e + 1).variables == [m.x[0]] and key(m.x[0]).variables == [m.x[0]]


def test_numbers_may_be_left_out():
    m = model()
    assert key(2 * m.x[0], number=any_number).tokens == key(3 * m.x[1], number=any_number).tokens


def test_variables_come_in_their_order_and_fixed_ones_too():
    m = model()
    m.x[1].fix(0)
    assert [v.name for v in key(m.x[2] + m.x[1] * m.x[2] + m.x[0]).variables] == ['x[2]', 'x[1]', 'x[0]']
