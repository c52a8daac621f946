"""Fresh data are those that Pyomo makes: the same attributes, each with containers and indicators of its own."""

from weakref import ref

import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunct
from pyomo.gdp.disjunct import DisjunctData
from pyomo.mpec import Complementarity

from pyomo_fesd.core.fresh_data import make_data


@pytest.fixture
def m():
    """Components with two indices."""
    m = pyo.ConcreteModel()
    m.disjunct, m.pair = Disjunct(['ours', 'pyomos'], dense=False), Complementarity(['ours', 'pyomos'])
    return m


def state(data):
    """Attributes of data and of the components on them by name; what is among these, by its place."""
    parts = [data, *data.component_map().values()]
    places = {id(part): f'part {k}' for k, part in enumerate(parts)}

    def described(value):
        value = value() if isinstance(value, ref) else value
        if isinstance(value, dict):
            return {key: described(inner) for key, inner in value.items()}
        if isinstance(value, (list, tuple)):
            return [described(inner) for inner in value]
        # initialisers are shared by all copies
        return places.get(id(value), type(value) if 'Initializer' in type(value).__name__ else value)

    names = ({*part.__auto_slots__.slots, *part.__dict__} for part in parts)
    return [{name: described(getattr(part, name)) for name in some} for part, some in zip(parts, names)]


@pytest.mark.parametrize('name', ['disjunct', 'pair'])
def test_they_have_the_attributes_of_pyomos(m, name):
    component = m.component(name)
    ours, pyomos = make_data(component, 'ours'), component._setitem_when_not_present('pyomos')
    assert component['ours'] is ours and ours.index() == 'ours' and ours.name == f'{name}[ours]'
    ours_now, pyomos_now = state(ours), state(pyomos)
    assert ours_now[0].pop('_index') == 'ours' and pyomos_now[0].pop('_index') == 'pyomos'
    assert ours_now == pyomos_now


def test_disjuncts_share_nothing_that_changes(m):
    one, other = make_data(m.disjunct, 'ours'), make_data(m.disjunct, 'pyomos')
    one.c = pyo.Constraint(expr=one.binary_indicator_var == 1)
    one.indicator_var.fix(True)
    assert one.binary_indicator_var.fixed and one.binary_indicator_var.value == 1
    assert one.binary_indicator_var.parent_block() is one and one.c.active
    assert other.component('c') is None and not other.indicator_var.fixed and other.binary_indicator_var.value is None
    other.deactivate()
    assert one.active and other.indicator_var.value is False


def test_a_clone_has_its_own(m):
    make_data(m.disjunct, 'ours')
    clone = m.clone()
    clone.disjunct['ours'].indicator_var.fix(True)
    assert clone.disjunct['ours'].binary_indicator_var.value == 1 and m.disjunct['ours'].indicator_var.value is None


def test_classes_derived_from_pyomos_make_their_own(m):
    class Data(DisjunctData):
        def __init__(self, component):
            super().__init__(component)
            self.mine = pyo.Var()

    class Mine(Disjunct):
        _ComponentDataClass = Data

    m.mine = Mine([0], dense=False)
    assert make_data(m.mine, 0).mine.ctype is pyo.Var
