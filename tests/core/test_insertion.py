"""Content at an index that is known to belong to a component's index set."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core.insertion import insert


@pytest.fixture
def m():
    """A variable over time, and a place for content with two indices, with one, and with none."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x = pyo.Var(m.t)
    m.both, m.one, m.none = pyo.Constraint(m.t, [1, 2]), pyo.Constraint(m.t), pyo.Constraint()
    m.pair = Complementarity(m.t, [1, 2])
    return m


@pytest.mark.parametrize('name, index, stored', [('both', (0, 2), (0, 2)), ('one', (0,), 0), ('none', (), None)])
def test_a_constraint_is_the_same_as_one_that_pyomo_adds(m, name, index, stored):
    component = m.component(name)
    data = insert(component, index, m.x[0] == 1)
    assert component[stored] is data and list(component) == [stored]
    assert str(data.expr) == 'x[0]  ==  1' and data.parent_component() is component and data.index() == stored


def test_a_pair_is_the_same_as_one_that_pyomo_adds(m):
    data = insert(m.pair, (1, 2), complements(m.x[0] >= 0, m.x[1] >= 0))
    assert m.pair[1, 2] is data and list(m.pair) == [(1, 2)] and data.active
    assert [str(side) for side in data._args] == ['0  <=  x[0]', '0  <=  x[1]']
