"""The positive part s = max(0, z) as one variable and one pair."""

import pyomo.environ as pyo
import pytest

from pyomo_fesd.core import add_positive_part, declare_positive_part, read_complementarity


@pytest.mark.parametrize('x, s', [(3.0, 2.0), (-1.0, 0.0), (None, 0.0)])
def test_it_starts_at_its_value_or_at_zero(x, s):
    m = pyo.ConcreteModel()
    m.x, m.b = pyo.Var(initialize=x), pyo.Block()
    declare_positive_part(m.b)
    found = add_positive_part(m.b, (), m.x - 1)
    assert found is m.b.s and (found.value, found.lb) == (s, 0)
    assert [str(side) for side in read_complementarity(m.b.complementarity)] == ['b.s', 'b.s - (x - 1)']


def test_over_sets_only_the_indices_that_are_added_exist():
    m = pyo.ConcreteModel()
    m.i, m.x, m.b = pyo.RangeSet(3), pyo.Var(initialize=1), pyo.Block()
    declare_positive_part(m.b, m.i, m.i)
    add_positive_part(m.b, (2, 3), m.x)
    assert list(m.b.s) == list(m.b.complementarity) == [(2, 3)]
