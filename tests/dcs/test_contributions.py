"""Several Disjunctions at one time are independent systems: contributions to one derivative add up (theory, section 1)."""

import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunct, Disjunction

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import above, add_modes, below, collocate, dcs, modes_on, scalar_ode
from tests.problems.running import SCHEMES, move, seen, solve


def two_relays(discretised=False):
    """dx = F + G: F = -2 above 0 and 2 below, G = -1 above 1 and 1 below.

    From x = 3 the rate is -3 until x = 1 at 2/3, then -1 until x = 0 at 5/3.  There F balances G = 1: 2 - 4 nu = -1, nu = 3/4.
    """
    m = scalar_ode(x0=3.0, end=3.0)
    m.F, m.G = pyo.Var(m.t), pyo.Var(m.t)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.sum = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.F[t] + m.G[t])
    m.y[0].fix(1)
    if discretised:
        collocate(m, nfe=9)
    add_modes(m, lambda m, t: [m.x[t] >= 0, m.F[t] == -2], lambda m, t: [m.x[t] <= 0, m.F[t] == 2], name='strong')
    return add_modes(m, lambda m, t: [m.x[t] >= 1, m.G[t] == -1], lambda m, t: [m.x[t] <= 1, m.G[t] == 1], name='weak')


@pytest.mark.parametrize('form', ['auto', 'stewart', 'heaviside'])
@pytest.mark.parametrize('discretised', [False, True])
def test_two_relays_on_one_state_add_up_and_one_slides_against_the_other(form, discretised):
    m = solve(move(dcs(two_relays(discretised), form=form), 9, 2))
    found = pyomo_fesd.switches(m)
    assert [s.disjunction for s in found] == ['weak', 'strong']
    assert found[1].after == 'sliding mode 1 | mode 2'
    assert [s.time for s in found] == pytest.approx([2 / 3, 5 / 3], abs=1e-9)
    last = pyomo_fesd.trajectory(m).iloc[-1]
    assert [last['x'], last['strong: mode 1'], last['weak: mode 1']] == pytest.approx([0, 0.75, 0], abs=1e-8)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_systems_of_different_states_add_up_in_a_third(scheme):
    # y clocks: dy = 1.  x gets 3 or 1 by its own sign, and 2 more from y = 1 on: -2, at 0 after 2/3, 1/3 at 1, then rate 3
    m = scalar_ode()
    m.F, m.G = pyo.Var(m.t), pyo.Var(m.t)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 1)
    m.sum = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.F[t] + m.G[t])
    m.y[0].fix(0)
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.F[t] == 3], lambda m, t: [m.x[t] >= 0, m.F[t] == 1], name='own')
    add_modes(m, lambda m, t: [m.y[t] <= 1, m.G[t] == 0], lambda m, t: [m.y[t] >= 1, m.G[t] == 2], name='late')
    solve(move(dcs(m), 9, 2, scheme=scheme))
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([2 / 3, 1], abs=1e-9)
    assert m.x[2].value == pytest.approx(1 / 3 + 3, abs=1e-9)


# Two that define the same variable


def twice_the_derivative():
    m = add_modes(scalar_ode(), below, above)
    return add_modes(m, lambda m, t: [m.y[t] <= 0, m.dx[t] == 5], lambda m, t: [m.y[t] >= 0, m.dx[t] == 6], name='again')


def twice_an_algebraic_variable():
    m = scalar_ode()
    m.F = pyo.Var(m.t)
    for name, v in (('sgn', m.x), ('again', m.y)):
        add_modes(m, lambda m, t, v=v: [v[t] <= 0, m.F[t] == 1], lambda m, t, v=v: [v[t] >= 0, m.F[t] == 2], name=name)
    return m


def twice_from_inside():
    m = add_modes(scalar_ode(), below, above)

    @m.Disjunct(m.t)
    def outer(d, t):
        d.region = pyo.Constraint(expr=m.y[t] >= 0)
        d.again = Disjunction(expr=[[m.y[t] <= 1, m.dx[t] == 5], [m.y[t] >= 1, m.dx[t] == 6]])

    @m.Disjunct(m.t)
    def other(d, t):
        d.region = pyo.Constraint(expr=m.y[t] <= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 7)

    m.again = Disjunction(m.t, rule=lambda m, t: [m.outer[t], m.other[t]])
    return m


TWICE = {
    'a derivative': (twice_the_derivative, 'dx[0]'),
    'an algebraic variable': (twice_an_algebraic_variable, 'F[0]'),
    'a derivative, from an inner mode': (twice_from_inside, 'dx[0]'),
}


@pytest.mark.parametrize('case', TWICE)
def test_a_variable_that_two_disjunctions_define_is_refused_by_name_of_all_three(case):
    build, name = TWICE[case]
    m = build()
    before = seen(m)
    with pytest.raises(FesdError, match=r"both 'sgn\[0\]' and 'again\[0\]' define it") as refusal:
        dcs(m)
    assert refusal.value.component == name and 'add them up' in refusal.value.fix
    assert seen(m) == before


def test_it_is_noticed_when_the_second_one_is_transformed_later():
    m = twice_the_derivative()
    dcs(m, targets=m.sgn)
    before = seen(m)
    with pytest.raises(FesdError, match=r"both 'sgn\[0\]' and 'again\[0\]' define it"):
        dcs(m)
    assert seen(m) == before


def test_it_is_noticed_in_a_clone():
    m = twice_the_derivative()
    dcs(m, targets=m.sgn)
    copy = m.clone()
    with pytest.raises(FesdError, match=r"both 'sgn\[0\]' and 'again\[0\]' define it"):
        dcs(copy)


def test_the_same_variable_at_different_times_is_defined_once():
    m = scalar_ode()
    m.early = Disjunction(m.t, rule=lambda m, t: [below(m, t), above(m, t)] if t == 0 else Disjunction.Skip)
    m.late = Disjunction(m.t, rule=lambda m, t: [below(m, t), above(m, t)] if t > 0 else Disjunction.Skip)
    dcs(m)
    m.x[0].value = m.x[2].value = 1.0
    assert [modes_on(m.early[0]), modes_on(m.late[2])] == [[m.early[0].disjuncts[1]], [m.late[2].disjuncts[1]]]
    assert not list(m.component_data_objects(Disjunct, active=True))
