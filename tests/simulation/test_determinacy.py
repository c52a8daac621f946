"""Undetermined unknowns are named."""

import gas_liquid_tank
import pyomo.environ as pyo
import pytest
import signum

from pyomo_fesd import FesdError
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
