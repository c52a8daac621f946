"""Walks that pass over References."""

import pyomo.environ as pyo
import pytest

from pyomo_fesd.core.own_data import own_data, variables_below


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
