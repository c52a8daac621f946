"""Impacts in a simulation: which contacts take part, and what stands at boundaries without one."""

import pyomo.environ as pyo
import pytest
from problems import contacts
from problems.running import move

import pyomo_fesd
from pyomo_fesd.core import moving_grids


def impacts(m):
    return moving_grids(m)[m.t].state_jumps.impacts


def test_touching_contacts_take_part_in_an_impact_of_one():
    # the first block hits the second, which touches the third
    m = move(contacts.blocks(0, (0, 2, 3), end=2.0), 4)
    pyomo_fesd.simulate(m)
    found = impacts(m)
    acting = [b for b in (1, 2, 3) if found.impulse['hit[1]', b].value > 1e-6]
    assert len(acting) == 1
    # (1, 0, 0) -> (1, 1, 1) / 3
    assert found.impulse['hit[1]', acting[0]].value == pytest.approx(2 / 3)
    assert found.impulse['hit[2]', acting[0]].value == pytest.approx(1 / 3)


def test_a_distant_contact_takes_no_part():
    m = move(contacts.blocks(0, (0, 2, 9), end=2.0), 4)
    pyomo_fesd.simulate(m)
    assert sum(v.value for (name, _), v in impacts(m).impulse.items() if name == 'hit[2]') == 0


def test_parts_satisfy_their_equations_at_every_boundary():
    m = move(contacts.ball(0.8, 1.5), 6)
    pyomo_fesd.simulate(m)
    found = impacts(m)
    rows = [c for c in found.parts.values() if c.equality]
    assert rows and max(abs(pyo.value(c.body) - pyo.value(c.upper)) for c in rows) < 1e-9
    assert min(v.value for some in (found.above, found.below, found.leaving) for v in some.values()) >= 0


def test_a_gap_of_positions_at_zero_closes_in_any_unit():
    m = move(contacts.pushed(end=0.5, L=1e-6), 3, 3)
    pyomo_fesd.simulate(m)
    assert max(v.value for v in impacts(m).impulse.values()) < 1e-12
