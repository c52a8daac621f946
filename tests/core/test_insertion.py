"""Content at an index that is known to belong to a component's index set."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core.insertion import VariableMaker, add_copies, insert


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


ATTRIBUTES = ('value', 'lb', 'ub', 'lower', 'upper', 'domain', 'fixed', 'stale')


@pytest.mark.parametrize(
    'keywords',
    [
        {},
        {'initialize': 3, 'bounds': (0, 5), 'domain': pyo.Reals},
        {'bounds': (None, 5), 'domain': pyo.NonNegativeReals, 'units': pyo.units.m},
    ],
)
def test_copies_of_variables_are_the_same_as_those_that_pyomo_makes(m, keywords):
    m.y, m.z = (pyo.Var(m.t, **keywords) for _ in range(2))
    for t in (0.5, 0.25):
        m.t.add(t)
    m.y[0].fix(4)
    m.y[0].setub(4.5)
    add_copies(m.y, [0.5, 0.25])
    for t in (0.5, 0.25):
        new, pyomos = m.y[t], m.z.add(t)
        assert [getattr(new, a) for a in ATTRIBUTES] == [getattr(pyomos, a) for a in ATTRIBUTES]
        assert new.index() == t and new.name == f'y[{t}]' and new.parent_component() is m.y
    m.y[0.5].value = 1
    assert m.y[0.25].value == keywords.get('initialize')


def test_a_variable_that_is_there_is_found_and_others_are_made_as_declared(m):
    m.y, maker = pyo.Var(m.t, [1, 2], dense=False, initialize=12, bounds=(0, 20)), VariableMaker()
    first = maker.at(m.y, (1, 2))
    assert list(m.y) == [(1, 2)] and maker.at(m.y, (1, 2)) is first is m.y[1, 2]
    first.setub(3)
    first.fix(2)
    other = maker.at(m.y, (0, 1))
    assert maker.at(m.y, (0, 1)) is other is m.y[0, 1] and other.index() == (0, 1)
    assert (other.value, other.lb, other.ub, other.fixed) == (12, 0, 20, False)
    assert maker.at(m.x, (0,)) is m.x[0]
