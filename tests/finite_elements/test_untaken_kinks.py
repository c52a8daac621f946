"""Kinks and jumps over time that no transformation took are named, with the call that takes them."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest

import pyomo_fesd
from tests.problems.running import move


def model(rhs):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.i = pyo.Set(initialize=['a', 'b'])
    m.x = pyo.Var(m.t, m.i, initialize=-1)
    m.p = pyo.Param(initialize=-3, mutable=True)
    m.up = pyo.Var(m.t, bounds=(0, None), initialize=1)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.flow = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dx[t, i] == rhs(m, t, i))
    return m


def named(m, caplog):
    move(m)
    return [r.message for r in caplog.records if 'kink or a jump' in r.message]


@pytest.mark.parametrize(
    'rhs, words',
    [
        (lambda m, t, i: abs(m.x[t, i]), 'abs: fesd.smooth_to_complementarity'),
        (lambda m, t, i: m.x[t, i] * abs(m.x[t, i] - 1), 'abs: fesd.smooth_to_complementarity'),
        (lambda m, t, i: pyo.ceil(m.x[t, i]), 'ceil: a Disjunction'),
        (lambda m, t, i: 2 + pyo.floor(m.x[t, i] / 2), 'floor: a Disjunction'),
        (lambda m, t, i: pyo.tanh(1e3 * m.x[t, i]), 'a steep tanh: a Disjunction'),
        (lambda m, t, i: pyo.tanh(-(m.x[t, i] - 1) / 1e-3), 'a steep tanh: a Disjunction'),
    ],
)
def test_a_kink_is_named_with_its_index_and_remedy(rhs, words, caplog):
    (message,) = named(model(rhs), caplog)
    assert f'flow[a] ({words}' in message and 'flow[b]' in message


@pytest.mark.parametrize(
    'rhs',
    [
        lambda m, t, i: pyo.tanh(m.x[t, i]),
        lambda m, t, i: abs(m.p) * m.x[t, i],
        lambda m, t, i: abs(m.up[t]) + m.x[t, i],
        lambda m, t, i: pyo.sqrt(m.x[t, i] ** 2 + 1),
    ],
)
def test_what_has_no_kink_is_not_named(rhs, caplog):
    assert named(model(rhs), caplog) == []


def test_what_a_transformation_took_is_not_named(caplog):
    m = model(lambda m, t, i: abs(m.x[t, i]))
    pyo.TransformationFactory('fesd.smooth_to_complementarity').apply_to(m)
    assert named(m, caplog) == []
    m = model(lambda m, t, i: 0)
    m.del_component(m.flow)

    @m.Block(m.t)
    def law(b, t):
        b.flow = pyo.Constraint(m.i, rule=lambda b, i: m.dx[t, i] == pyomo_fesd.absolute(b, m.x[t, i]))

    assert named(m, caplog) == []


def test_a_kink_in_a_guard_or_an_integrand_is_named(caplog):
    m = model(lambda m, t, i: 1)
    m.hit = pyomo_fesd.state_jump(m.t, guard=lambda m, t: abs(m.x[t, 'a']) + 1, reset=lambda m, t: [(m.x[t, 'a'], 0)])
    m.work = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: abs(m.x[t, 'b']))
    (message,) = named(m, caplog)
    assert 'hit (abs' in message and 'work (abs' in message


def test_many_kinks_are_counted(caplog):
    m = model(lambda m, t, i: 1)
    for k in range(8):
        m.add_component(f'c{k}', pyo.Constraint(m.t, rule=lambda m, t: abs(m.x[t, 'a']) <= 1e9))
    (message,) = named(m, caplog)
    assert 'and 3 more' in message
