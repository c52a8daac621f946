"""Violations of a failed solve are named by the user's components, modes and physical time, without generated names."""

import bouncing_ball
import pump_curve
import pyomo.environ as pyo
import pytest
import thermostat
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import GENERATED, moving_grids
from pyomo_fesd.finite_elements import refuse_first_modes
from pyomo_fesd.solvers import user_names
from tests.models import dcs, finite_elements, signum, signum_of_scalars, thresholds
from tests.problems import thermostats


def unreachable(form):
    m = signum()
    m.y[0].fix(1.0)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.end = pyo.Constraint(expr=m.x[2] >= 50)
    return finite_elements(dcs(m, form=form), 3)


def hot_room():
    m = thermostat.build()
    m.end = pyo.Constraint(expr=m.y[m.t.last()] >= 50)
    return finite_elements(dcs(m, hysteresis=[m.relay]), 4)


def high_ball():
    m = bouncing_ball.build()
    if not moving_grids(m):
        finite_elements(m, 4)
    m.end = pyo.Constraint(expr=m.q[m.t.last()] >= 50)
    return m


def pumped():
    m = pump_curve.build()
    return m if moving_grids(m) else finite_elements(dcs(m), [2] * (len(m.t) - 1))


MODELS = {
    'heaviside': lambda: unreachable('heaviside'),
    'stewart': lambda: unreachable('stewart'),
    'thresholds': lambda: finite_elements(dcs(thresholds()), scheme='LAGRANGE-LEGENDRE'),
    'blocks': lambda: finite_elements(dcs(signum_of_scalars())),
    'hysteresis': hot_room,
    'jumps': high_ball,
    'table': pumped,
}


@pytest.mark.parametrize('model', MODELS)
def test_every_equation_and_pair_has_a_name_of_the_user(model):
    m = MODELS[model]()
    name = user_names(m)
    found = {
        c.name: name(c) for c in m.component_data_objects((pyo.Constraint, Complementarity), active=True, descend_into=pyo.Block)
    }
    assert any(GENERATED in generated for generated in found)
    assert not [words for words in found.values() if GENERATED in words]


def test_a_failed_solve_names_the_modes_and_physical_time():
    results = pyo.SolverFactory('mpec_hybrid').solve(unreachable('heaviside'))
    names = [name for name, _ in results.solver.violated]
    assert results.solver.termination_condition == 'infeasible' and GENERATED not in results.solver.reason
    assert any('sgn ' in name or 'below.ode | above.ode' in name for name in names) and any('time' in name for name in names)


def started_at(y):
    m = thermostats.build()
    m.y['a', 0].fix(y)
    return finite_elements(dcs(m, hysteresis=[m.relay]), 4)


@pytest.mark.parametrize('step', [pyomo_fesd.simulate, lambda m: pyo.SolverFactory('mpec_hybrid').solve(m)])
def test_a_first_mode_outside_of_its_region_is_named_at_once(step):
    with pytest.raises(FesdError, match=r'^relay\[a\]: heating.*at time 0.*20.0 - y\[a,0\] = -0.5 is negative'):
        step(started_at(20.5))


def test_a_first_mode_on_the_edge_of_its_region_is_accepted():
    refuse_first_modes(started_at(20.0))


def test_a_guard_that_is_negative_at_first():
    m = high_ball()
    m.q[0].fix(-1.0)
    with pytest.raises(FesdError, match=r'^impact: its guard.*at time 0.*q\[0\] = -1 is negative'):
        pyomo_fesd.simulate(m)
