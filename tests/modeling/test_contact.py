"""Rigid contacts: what the Block holds, and its errors."""

import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import switched_systems
from pyomo_fesd.finite_elements.contacts import read_contacts
from tests.models import scalar_ode


def test_gap_and_force_stand_on_a_block_over_time():
    m = scalar_ode(discretised=True)
    m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t] - 1)
    assert set(m.floor) == set(m.t)
    assert str(m.floor[0].gap.expr) == 'x[0] - 1' and m.floor[0].normal.lb == 0
    (entry,) = switched_systems(m.floor[0]).contacts
    assert entry.gap is m.floor[0].gap and entry.forces == (m.floor[0].normal,) and entry.restitution == 0


def test_contacts_over_other_sets_are_laws_of_their_own():
    m = scalar_ode()
    m.floor = pyomo_fesd.contact(['a', 'b'], m.t, gap=lambda m, i, t: m.x[t], restitution=lambda m, i, t: 0.5 * (i == 'b'))
    assert [(law.name, law.restitution) for law in read_contacts(m, m.t)] == [('floor[a]', 0), ('floor[b]', 0.5)]


def test_restitution_may_be_a_param():
    m = scalar_ode()
    m.e = pyo.Param(initialize=0.3, mutable=True)
    m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t], restitution=m.e)
    (law,) = read_contacts(m, m.t)
    assert law.restitution is m.e


def test_a_clone_has_its_own_contact():
    m = scalar_ode()
    m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t])
    copy = m.clone()
    (law,) = read_contacts(copy, copy.t)
    assert law.gaps[0].model() is copy and law.forces[0][0] is copy.floor[0].normal


@pytest.mark.parametrize('gap', [lambda m, t: m.x[t] >= 0, lambda m, t: None, lambda m, t: 1.0])
def test_a_gap_that_is_no_expression_is_refused(gap):
    m = scalar_ode()
    with pytest.raises(FesdError, match=r'floor\[0\]: its gap is .*, not an expression'):
        m.floor = pyomo_fesd.contact(m.t, gap=gap)


@pytest.mark.parametrize('e', [-0.1, 1.5])
def test_a_restitution_that_is_none_is_refused(e):
    m = scalar_ode()
    with pytest.raises(FesdError, match=r'floor\[0\]: its restitution is '):
        m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t], restitution=e)


def test_a_restitution_that_varies_is_refused():
    m = scalar_ode()
    with pytest.raises(FesdError, match=r"floor\[0\]: its restitution is 'x\[0\]', not a number or Param"):
        m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t], restitution=lambda m, t: m.x[t])


def test_slip_and_friction_belong_together():
    m = scalar_ode()
    with pytest.raises(FesdError, match='friction and slip belong together'):
        m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t], friction=0.3)


def test_a_negative_friction_is_refused():
    m = scalar_ode()
    with pytest.raises(FesdError, match=r"floor\[0\]: its friction is '-1', not a coefficient"):
        m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t], friction=-1, slip=lambda m, t: m.y[t])
