"""Undetermined unknowns are named."""

import gas_liquid_tank
import pyomo.environ as pyo
import pytest
import signum
from pyomo.dae import DerivativeVar

from pyomo_fesd import FesdError, simulate
from pyomo_fesd.simulation import determinacy
from pyomo_fesd.simulation.determinacy import refuse_undetermined
from tests.models import scalar_ode
from tests.problems import air_friction, dumped, quadratic_drag, relay_of_states, resting_ball, sliding, weir
from tests.problems.running import SCHEMES, move, transform
from tests.simulation.test_equation_reader import problems


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize('build', [signum.build, sliding.build, gas_liquid_tank.build, air_friction.build])
def test_switching_systems_are_determined(build, form, scheme):
    for equations in problems(transform(build(), 3, 2, form=form, scheme=scheme)):
        refuse_undetermined(equations)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('build', [weir.build, weir.build_series, relay_of_states.build, resting_ball.build, dumped.build])
def test_hand_written_conditions_count(build, scheme):
    for equations in problems(move(build(), 3, 2, scheme=scheme)):
        refuse_undetermined(equations)


def test_nonsmooth_terms_count():
    for equations in problems(move(quadratic_drag.build(3, 2), 3, 2)):
        refuse_undetermined(equations)


def test_what_is_free_is_named():
    m = scalar_ode(end=2)
    m.u = pyo.Var(m.t, initialize=0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    with pytest.raises(FesdError, match=r'nothing determines u\[.*, or another variable in the same equations') as error:
        refuse_undetermined(problems(move(m, 2, 2))[0])
    assert 'inputs' in error.value.fix


def test_a_condition_that_is_missing_is_noticed():
    m = weir.build()
    m.overflow.deactivate()
    m.del_component(m.overflow)
    with pytest.raises(FesdError, match='nothing determines'):
        refuse_undetermined(problems(move(m, 2, 2))[0])


def controller(gain):
    """dI/dt = 1, and one equation without a time for I, u and the derivative of x at the first time."""
    m = scalar_ode(x0=0.0)
    m.gain, m.u = pyo.Var(initialize=gain), pyo.Var(m.t, initialize=0)
    m.gain.fix()
    m.u[0].fix(3.0)
    m.initial = pyo.Constraint(expr=m.y[0] == m.u[0] + m.gain * m.dx[0])
    m.rate = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 1)
    m.law = pyo.Constraint(m.t, rule=lambda m, t: (m.dx[t] if t else m.u[t] - 3) == 0)
    m.follow = pyo.Constraint(m.t, rule=lambda m, t: m.u[t] == m.y[t] if t else pyo.Constraint.Skip)
    m.law[0].deactivate()
    return move(m, 3)


def test_an_equation_without_a_time_gives_an_initial_value_where_the_rest_of_it_does_not_count():
    """The integral of a PID controller from its first output: the derivative there is unknown, with a gain of 0."""
    m = controller(0.0)
    simulate(m)
    assert m.y[0].value == pytest.approx(3.0) and m.u[2].value == pytest.approx(5.0)


def test_what_hides_an_initial_value_is_named():
    with pytest.raises(FesdError, match=r"(?s)y\[0\].*also contains 'dx\[0\]', which nothing else.*Fix: fix.*or 'dx\[0\]'"):
        simulate(controller(0.5))


def test_equal_bounds_state_an_equation():
    m = scalar_ode(x0=0.0)
    m.y[0].fix(1.0)
    m.rate = pyo.Constraint(m.t, rule=lambda m, t: (1, m.dx[t], 1))
    m.other = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.x[t])
    simulate(move(m, 2))
    assert m.x[2].value == pytest.approx(2.0) and m.y[2].value == pytest.approx(3.0)


def test_the_first_of_several_states_without_a_value_is_named():
    m = scalar_ode(x0=0.0)
    m.x[0].unfix()
    m.rate = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1)
    m.other = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.x[t])
    with pytest.raises(FesdError, match=r"x\[0\].*neither fixed at the first time") as error:
        simulate(move(m, 2))
    assert 'fix its initial value' in error.value.fix


def test_equations_are_read_once_for_all_states(monkeypatch):
    """Reading them for each state took the time of the square of the states."""
    m = scalar_ode(x0=0.0)
    m.line = pyo.Set(initialize=range(20))
    m.z = pyo.Var(m.t, m.line, initialize=1.0)
    m.dz = DerivativeVar(m.z, wrt=m.t)
    m.z[0, :].fix(1.0)
    m.rate = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1)
    m.other = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.rates = pyo.Constraint(m.t, m.line, rule=lambda m, t, i: m.dz[t, i] == -m.z[t, i])
    m.begin = pyo.Constraint(m.line, rule=lambda m, i: m.z[0, i] == 1.0)
    m.y[0].fix(0.0)
    m.z[0, :].unfix()
    read = []
    original = determinacy.variables_that_count
    monkeypatch.setattr(determinacy, 'variables_that_count', lambda row: read.append(row) or original(row))
    simulate(move(m, 1, 1))
    # both sides of an equation are one row: at the first time once, in the element once
    assert len(read) == len({id(row) for row in read})
