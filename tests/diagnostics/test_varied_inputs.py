"""A fixed input with two values inside a control stage is named: its values belong to labels that move."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd.diagnostics.varied_inputs import varied_inputs
from tests.problems.running import transform

STEP = 2.0


def relay(*inner):
    """x' = u - 1 below 3, u - 2 above: a switch, and an input u; ``inner`` are boundaries of control stages."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, *inner, 4])
    m.x, m.u = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=3)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 3, m.dx[t] == m.u[t] - 1], [m.x[t] >= 3, m.dx[t] == m.u[t] - 2]])
    return transform(m, 8)


def fixed(m, value_at):
    for t in m.t:
        m.u[t].fix(value_at(t))
    return m


def messages(m):
    return list(varied_inputs(m, m.t, []))


@pytest.mark.parametrize('value_at', [lambda t: 3, lambda t: 3 if t <= STEP else 5, lambda t: 7 if t == 0 else 3])
def test_one_value_for_each_control_stage_is_what_a_held_input_is(value_at):
    assert not messages(fixed(relay(STEP), value_at))


def test_the_new_value_on_the_label_of_the_old_stages_end_is_named_with_the_cure():
    (message,) = messages(fixed(relay(STEP), lambda t: 3 if t < STEP else 5))
    assert message.startswith('u: it is fixed to 3 and, from the label 2 on, to 5 inside the control stage that ends at time 2;')
    assert 't > 2' in message


def test_a_step_or_a_profile_inside_a_stage_is_named_with_a_signal_as_the_cure():
    (message,) = messages(fixed(relay(), lambda t: 3 if t < STEP else 5))
    assert 'signal' in message and 'from the label 2 on' in message
    assert messages(fixed(relay(), lambda t: 3 + t))


def test_states_at_the_first_time_free_inputs_and_signals_are_not_mentioned():
    m = relay()
    assert not messages(m)
    m.u[4].fix(9)
    assert not messages(m)


def test_a_simulation_warns(caplog):
    pyomo_fesd.simulate(fixed(relay(STEP), lambda t: 3 if t < STEP else 5))
    assert 'inside the control stage that ends at time 2' in caplog.text
