"""Sums and products are those of Pyomo's operators."""

from math import prod

import pyomo.environ as pyo
import pytest
from pyomo.core.expr.compare import compare_expressions

from pyomo_fesd.core import product_of, sum_of, weighted_sum


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1, 2, 3])
    m.scalar = pyo.Var()
    m.p = pyo.Param(mutable=True, initialize=2)
    return m


@pytest.fixture
def terms(m):
    x = m.x
    return {
        'none': [],
        'one': [x[1]],
        'linear': [x[1], 1 - x[2], m.scalar],
        'numbers': [2, 3.0],
        'other': [x[1] * x[2], pyo.exp(x[3]), m.p],
        'shared': [x[1] + x[2], x[3]],
    }


NAMES = ['none', 'one', 'linear', 'numbers', 'other', 'shared']


def compare(found, expected):
    """The same classes of nodes with the same arguments."""
    assert found.__class__ is expected.__class__ and str(found) == str(expected)
    assert compare_expressions(found, expected)


@pytest.mark.parametrize('name', NAMES)
def test_sums_and_products(terms, name):
    compare(sum_of(terms[name]), sum(terms[name]))
    compare(product_of(terms[name]), prod(terms[name]))


@pytest.mark.parametrize('weights', [(0.5, -2.0, 3.0), (1.0, 0.0, 0.5), (1, 2, -1)])
@pytest.mark.parametrize('name', NAMES)
def test_weighted_sums(terms, name, weights):
    pairs = list(zip(weights, terms[name]))
    compare(weighted_sum(pairs), sum(weight * x for weight, x in pairs))


def test_a_sum_does_not_change_its_terms(m):
    first = m.x[1] + m.x[2]
    sum_of([first, m.x[3]])
    assert str(first) == 'x[1] + x[2]'
