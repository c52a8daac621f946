"""The sign of z, where declared bounds tell it."""

import pyomo.environ as pyo
import pytest

from pyomo_fesd.kinks.bounds import known_sign


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
