"""Dry friction of any force law: in the plane and in space, and its errors."""

from math import cos, pi, sin

import pyomo.environ as pyo
import pytest
from problems.states import over_time

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import scalar_ode
from tests.problems.running import move


def pushed(end=3.0):
    """A block of mass 1 with friction 2, pushed by a force that grows with time."""
    m = over_time(end, x=0.0, v=0.0)
    clock = pyomo_fesd.clock(m, m.t)
    m.rub = pyomo_fesd.friction(m.t, velocity=lambda m, t: m.v[t], limit=lambda m, t: 2)
    m.way = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])
    m.push = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == clock[t] + m.rub[t].force)
    return m


def test_a_block_that_sticks_until_the_push_is_strong_enough():
    m = move(pushed(), 6, 3)
    pyomo_fesd.simulate(m)
    (switch,) = pyomo_fesd.switches(m)
    assert (switch.disjunction, switch.before, switch.after) == ('rub.force', 'sticks', 'slips forward')
    assert switch.time == pytest.approx(2, abs=1e-7)
    assert (m.v[3].value, m.x[3].value) == pytest.approx((1 / 2, 1 / 6), abs=1e-7)


def test_the_force_is_against_the_slip():
    m = scalar_ode()
    m.rub = pyomo_fesd.friction(m.t, velocity=lambda m, t: m.x[t], limit=lambda m, t: 3)
    law = m.rub[0].component('_pyomo_fesd_force')
    for nu, force in ((1, -3), (0.5, 0), (0, 3)):
        law.alpha.value = nu
        assert pyo.value(m.rub[0].force) == pytest.approx(force)


@pytest.mark.parametrize('directions', [4, 8])
def test_forces_in_space_lie_in_a_polygon(directions):
    m = scalar_ode()
    m.rub = pyomo_fesd.friction(m.t, velocity=lambda m, t: [m.x[t], m.y[t]], limit=lambda m, t: 3, directions=directions)
    law = m.rub[0].component('_pyomo_fesd_force')
    assert len(law.nu) == directions
    for i in law.nu:
        for j in law.nu:
            law.nu[j].value = float(i == j)
        turn = 2 * pi * (i - 1) / directions
        assert [pyo.value(m.rub[0].force[k]) for k in (1, 2)] == pytest.approx([3 * cos(turn), 3 * sin(turn)])


@pytest.mark.parametrize('velocity', [lambda m, t: [m.x[t]] * 3, lambda m, t: 1.0])
def test_a_velocity_that_is_none_is_refused(velocity):
    m = scalar_ode()
    with pytest.raises(FesdError, match=r'rub\[0\]: its slip velocity is'):
        m.rub = pyomo_fesd.friction(m.t, velocity=velocity, limit=lambda m, t: 3)


def test_too_few_directions_are_refused():
    m = scalar_ode()
    with pytest.raises(FesdError, match='directions=3'):
        m.rub = pyomo_fesd.friction(m.t, velocity=lambda m, t: m.x[t], limit=lambda m, t: 3, directions=3)
