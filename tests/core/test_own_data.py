"""Walks that pass over References."""

import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunct

from pyomo_fesd.core.own_data import count_of, declared, own_components, own_data, variables_below


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(), pyo.Var([1, 2])
    m.b = pyo.Block()
    m.b.z = pyo.Var([1, 2])
    m.b.again = pyo.Reference(m.y)
    m.again = pyo.Reference(m.b.z)
    return m


def names(found):
    return [v.name for v in found]


def test_data_of_references_are_passed_over(m):
    assert names(own_data(m, pyo.Var, pyo.Block)) == ['x', 'y[1]', 'y[2]', 'b.z[1]', 'b.z[2]']


def test_a_whole_model_has_each_variable_once(m):
    assert names(variables_below(m)) == ['x', 'y[1]', 'y[2]', 'b.z[1]', 'b.z[2]']


def test_a_block_has_those_too_that_a_reference_names(m):
    assert names(variables_below(m.b)) == ['b.z[1]', 'b.z[2]', 'y[1]', 'y[2]']


def test_blocks_that_are_not_active_are_left_out_on_request(m):
    m.b.deactivate()
    assert names(variables_below(m, active=True)) == ['x', 'y[1]', 'y[2]']
    assert len(names(variables_below(m))) == 5


def test_components_come_in_the_order_of_pyomo_from_disjuncts_too():
    m = pyo.ConcreteModel()
    m.b = pyo.Block([1, 2], rule=lambda b, i: b.add_component('z', pyo.Var()))
    m.d = Disjunct([1, 2])
    m.d[1].inner = pyo.Block([1, 2], rule=lambda b, i: b.add_component('u', pyo.Var([1, 2])))
    m.d[2].e = Disjunct()
    m.d[2].e.v = pyo.Var()
    m.x = pyo.Var()
    places = (pyo.Block, Disjunct)
    assert list(own_components(m, pyo.Var, places)) == list(m.component_objects(pyo.Var, descend_into=places))
    assert names(own_components(m, (pyo.Var, pyo.Block), pyo.Block)) == ['b', 'x', 'b[1].z', 'b[2].z']


def test_a_reference_to_a_block_is_no_place_of_its_own(m):
    m.c = pyo.Block([1, 2], rule=lambda c, i: c.add_component('w', pyo.Var()))
    m.once_more = pyo.Reference(m.c)
    assert names(own_data(m, pyo.Var, pyo.Block))[-2:] == ['c[1].w', 'c[2].w']


def test_declared_components_come_in_the_order_of_their_declaration(m):
    m.c, m.last = pyo.Constraint(expr=m.x == 0), pyo.Var()
    assert names(declared(m, {pyo.Constraint, pyo.Var})) == ['x', 'y', 'again', 'c', 'last']
    assert names(declared(m, {pyo.Constraint})) == ['c']
    assert names(declared(m, {Disjunct})) == []


def test_deleted_components_are_declared_no_longer(m):
    for name in ('x', 'again'):
        m.del_component(name)
    assert names(declared(m, {pyo.Var})) == ['y']
    for name in ('y', 'b'):
        m.del_component(name)
    assert names(declared(m, {pyo.Var, pyo.Block})) == []


def test_components_of_another_type_are_declared_under_it(m):
    m.reclassify_component_type('x', pyo.Block)
    assert names(declared(m, {pyo.Var})) == ['y', 'again']
    assert names(declared(m, {pyo.Block})) == ['x', 'b']
    m.reclassify_component_type('x', pyo.Var)
    assert names(declared(m, {pyo.Var})) == ['x', 'y', 'again']


def test_blocks_below_are_passed_over_on_request():
    m = pyo.ConcreteModel()
    m.b = pyo.Block([1, 2], rule=lambda b, i: b.add_component('z', pyo.Var()))
    m.b[1].c = pyo.Block()
    m.b[1].c.w = pyo.Var()
    asked = []

    def enter(block):
        asked.append(block.name)
        return block.name != 'b[1]'

    assert names(own_components(m, pyo.Var, pyo.Block, enter=enter)) == ['b[2].z']
    assert asked == ['b[1]', 'b[2]']


def test_components_of_a_type_are_counted_on_the_block_itself(m):
    assert [count_of(m, ctype) for ctype in (pyo.Var, pyo.Block, pyo.Constraint)] == [3, 1, 0]
    m.del_component(m.x)
    assert count_of(m, pyo.Var) == 2
