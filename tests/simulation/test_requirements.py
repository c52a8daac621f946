"""Conditions that determine nothing are left out of a simulation; those that do are not."""

import pyomo.environ as pyo
import pytest
from problems import contacts, weir
from problems.running import SCHEMES, move
from pyomo.mpec import Complementarity, complements

import pyomo_fesd


def levels(m):
    pyomo_fesd.simulate(m)
    return pyomo_fesd.trajectory(m)['V'].to_numpy()


def required(drained=0.3):
    """The weir with a drain D = 0.3, which no equation contains; |D| should be zero while the tank flows over."""
    m = weir.build()
    m.D = pyo.Var(m.t, initialize=drained)
    m.D.fix()
    return m


def by_one_variable():
    """0 <= F perp w >= |D|."""
    m = required()
    m.w = pyo.Var(m.t, bounds=(0, None))
    m.size = pyo.Constraint([-1, 1], m.t, rule=lambda m, side, t: side * m.D[t] <= m.w[t])
    m.closed = Complementarity(m.t, rule=lambda m, t: complements(m.F[t] >= 0, m.w[t] >= 0))
    return move(m, 4, continuous=[m.w])


def by_two_parts():
    """D = p - n, 0 <= F perp p >= 0, 0 <= F perp n >= 0."""
    m = required(-0.3)
    m.p, m.n = pyo.Var(m.t, bounds=(0, None)), pyo.Var(m.t, bounds=(0, None))
    m.parts = pyo.Constraint(m.t, rule=lambda m, t: m.D[t] == m.p[t] - m.n[t])
    m.closed_p = Complementarity(m.t, rule=lambda m, t: complements(m.F[t] >= 0, m.p[t] >= 0))
    m.closed_n = Complementarity(m.t, rule=lambda m, t: complements(m.F[t] >= 0, m.n[t] >= 0))
    return move(m, 4, continuous=[m.p, m.n])


@pytest.mark.parametrize('build', [by_one_variable, by_two_parts])
def test_the_rest_is_simulated_as_without_them(build):
    assert levels(build()) == pytest.approx(levels(move(weir.build(), 4)), abs=1e-9)


def test_variables_are_zero_where_the_condition_says_so_and_else_fulfil_their_equation():
    m = by_two_parts()
    pyomo_fesd.simulate(m)
    flows_over = [t for t in m.t if m.F[t].value > 0.5]
    dry = [t for t in m.t if t not in flows_over]
    assert flows_over and all(m.p[t].value == m.n[t].value == 0 for t in flows_over)
    assert dry and all(m.n[t].value == pytest.approx(0.3) and m.p[t].value == 0 for t in dry)


def test_a_variable_without_a_value_gets_zero_and_another_keeps_its_own():
    m = by_one_variable()
    m.w[m.t.first()].set_value(0.3)
    pyomo_fesd.simulate(m)
    assert m.w[m.t.first()].value == 0.3
    assert {m.w[t].value for t in m.t if t != m.t.first()} == {0.0}


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_condition_that_determines_its_variable_is_solved(scheme):
    m = weir.build()
    m.y = pyo.Var(m.t, initialize=0, bounds=(0, None))
    m.excess = Complementarity(m.t, rule=lambda m, t: complements(m.y[t] >= 0, m.y[t] - m.V[t] + 0.4 >= 0))
    move(m, 6, scheme=scheme, continuous=[m.y])
    pyomo_fesd.simulate(m)
    last = m.t.last()
    assert m.y[last].value == pytest.approx(m.V[last].value - 0.4)


def test_a_requirement_on_a_contact_leaves_the_law_of_friction():
    """The block slips up and sticks, or slips back; it may not lift a finger while the table carries it."""
    plain, asked = (contacts.incline(0.5) for _ in range(2))
    asked.lift = pyo.Var(asked.t, bounds=(0, None))
    name, ground = next((c.local_name, c) for c in asked.component_objects(pyo.Block, descend_into=False) if c.is_indexed())
    asked.still = Complementarity(asked.t, rule=lambda m, t: complements(ground[t].normal >= 0, m.lift[t] >= 0))
    found = []
    for m in (move(plain, 6), move(asked, 6, continuous=[asked.lift])):
        pyomo_fesd.simulate(m)
        found.append([pyo.value(m.component(name)[t].friction) for t in m.t])
    assert found[1] == pytest.approx(found[0], abs=1e-7)
    assert len(set(map(round, found[0]))) > 1
