"""Balances of momentum at one boundary: masses, directions and normal velocities, and what is refused."""

import pyomo.environ as pyo
import pytest
from problems.running import move, seen
from problems.states import over_time
from pyomo.common.collections import ComponentSet

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import TimeIndex
from pyomo_fesd.finite_elements.impulse_balance import BoundaryEquations
from tests.problems import contacts
from tests.problems.contacts import G


def balances(m, contact):
    """The balances at the first time, and the equations."""
    equations = BoundaryEquations(m, TimeIndex(m.t), {0})
    return equations, equations.momentum([contact[0].normal])


def test_masses_and_directions_are_coefficients():
    m = contacts.discs(0.5)
    _, groups = balances(m, m.hit)
    # no mass couples the four velocities; the normal is (-2, 0.6) / |.|
    assert [group.states[0].name for group in groups] == ['v[1,x,0]', 'v[1,y,0]', 'v[2,x,0]', 'v[2,y,0]']
    assert [pyo.value(group.masses[0][0]) for group in groups] == [1, 1, 2, 2]
    length = (2**2 + 0.6**2) ** 0.5
    slopes = [pyo.value(group.forces[0][m.hit[0].normal]) for group in groups]
    assert slopes == pytest.approx([2 / length, -0.6 / length, -2 / length, 0.6 / length])


def test_a_mass_matrix_is_one_group():
    m = over_time(1.0, x=0.0, v=0.0, w=0.0)
    m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t])
    m.first = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: 2 * m.dv[t] + m.dw[t] == -G + m.floor[t].normal)
    m.turn = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] + 3 * m.dw[t] == 0)
    _, (group,) = balances(m, m.floor)
    order = [v.name for v in group.states]
    assert sorted(order) == ['v[0]', 'w[0]']
    masses = {tuple(pyo.value(row[order.index(name)]) for name in ('v[0]', 'w[0]')) for row in group.masses}
    assert masses == {(2, 1), (1, 3)}


def test_the_normal_velocity_is_the_rate_of_the_gap():
    m = contacts.discs(0.5)
    equations, groups = balances(m, m.hit)
    velocities = ComponentSet(v for group in groups for v in group.states)
    gamma = equations.normal_velocity(m.hit[0].gap.expr, m.hit[0], velocities)
    assert pyo.value(gamma) == pytest.approx(2 * -2 / (2**2 + 0.6**2) ** 0.5)


def refused(m, match, **keywords):
    before = seen(m)
    with pytest.raises(FesdError, match=match) as error:
        move(m, 3, 2, **keywords)
    assert seen(m) == before
    return error.value


def test_a_force_that_acts_nowhere_is_refused():
    m = over_time(1.0, q=1.0, v=0.0)
    m.table = pyomo_fesd.contact(m.t, gap=lambda m, t: m.q[t])
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.momentum = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -G)
    refused(m, r'table\[.*\].normal: contact: no equation contains this force')


def test_a_force_in_an_algebraic_equation_is_refused():
    m = contacts.ball(0)
    m.power = pyo.Var(m.t)
    m.define = pyo.Constraint(m.t, rule=lambda m, t: m.power[t] == m.table[t].normal * m.v[t])
    refused(m, r'define\[.*\]: contact: it contains the force .* but no derivative')


def test_a_gap_of_an_algebraic_variable_is_refused():
    m = over_time(1.0, q=1.0, v=0.0)
    m.d = pyo.Var(m.t)
    m.define = pyo.Constraint(m.t, rule=lambda m, t: m.d[t] == m.q[t])
    m.table = pyomo_fesd.contact(m.t, gap=lambda m, t: m.d[t])
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.momentum = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -G + m.table[t].normal)
    refused(m, r"its gap contains 'd\[.*\]', which is algebraic")


def test_a_rate_that_no_single_equation_gives_is_refused():
    m = contacts.ball(0)
    m.again = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] - m.v[t] == m.q[t] - m.q[t])
    refused(m, r"the gap depends on 'q\[.*\]', and 2 equation")
