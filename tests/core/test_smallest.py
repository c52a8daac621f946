"""Weights of the smallest of several functions."""

from math import isnan

import pyomo.environ as pyo
import pytest

from pyomo_fesd.core import add_smallest, all_switched_systems, declare_smallest
from pyomo_fesd.core.smallest import smallest_values


def test_values_of_the_smallest_and_of_ties():
    mu, *others = smallest_values([3.0, 1.0, 2.0])
    assert (mu, others) == (1.0, [2.0, 0.0, 1.0, 0.0, 1.0, 0.0])
    mu, *others = smallest_values([1.0, 1.0, 2.0])
    assert mu == 1.0 and others[:3] == [0.0, 0.0, 1.0]
    assert isnan(others[3]) and isnan(others[4]) and others[5] == 0.0


@pytest.mark.parametrize('sets', [(), ([0, 1],)])
def test_the_conditions_hold_at_the_values(sets):
    m = pyo.ConcreteModel()
    m.x, m.law = pyo.Var(initialize=2.0), pyo.Block()
    declare_smallest(m.law, sets, 3)
    index = (0,) if sets else ()
    nu = add_smallest(m.law, index, [m.x, -m.x, 0 * m.x])
    (rule,) = all_switched_systems(m).dependents
    for v, number in zip(rule.variables, rule.values([2.0, -2.0, 0.0])):
        v.value = number
    assert [v.value for v in nu] == [0, 1, 0]
    rows = list(m.component_data_objects(pyo.Constraint, descend_into=True))
    assert max(abs(pyo.value(c.body) - pyo.value(c.upper)) for c in rows) < 1e-12
    assert len(m.law.complementarity) == 3
