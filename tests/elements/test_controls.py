"""Controls held constant on each control stage."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import dcs
from tests.problems import held_control, setpoint
from tests.problems.running import EXACT_SCHEMES, LEGENDRE, RADAU, SCHEMES, move, seen, solve, transform


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_a_control_held_on_two_stages_reaches_the_optimum(scheme, ncp):
    m = held_control.build()
    solve(transform(m, nfe=6, ncp=ncp, scheme=scheme, piecewise_constant=[m.u]))
    for t in m.t:
        assert m.u[t].value == pytest.approx(held_control.CONTROLS[0 if t <= 1 else 1], abs=1e-6)
    assert pyo.value(m.cost) == pytest.approx(held_control.VALUE, abs=1e-7)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(held_control.SWITCH, abs=1e-6)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_one_control_without_a_list_is_held_too(scheme):
    m = held_control.build()
    solve(transform(m, nfe=6, scheme=scheme, piecewise_constant=m.u))
    assert len({round(m.u[t].value, 8) for t in m.t}) == 2


def test_controls_with_further_indices_are_held_one_by_one():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.i = pyo.RangeSet(2)
    m.x = pyo.Var(m.t, m.i, initialize=0)
    m.u = pyo.Var(m.i, m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.ode = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dx[t, i] == m.u[i, t])
    target = {(1, 1): 1.0, (2, 1): 3.0, (1, 2): -1.0, (2, 2): -5.0}
    for i in m.i:
        m.x[0, i].fix(0)
    m.goal = pyo.Objective(expr=sum((m.x[t, i] - x) ** 2 for (t, i), x in target.items()))
    solve(move(m, nfe=4, ncp=2, piecewise_constant=[m.u]))
    for t in m.t:
        assert m.u[1, t].value == pytest.approx(1.0 if t <= 1 else 2.0, abs=1e-6)
        assert m.u[2, t].value == pytest.approx(-1.0 if t <= 1 else -4.0, abs=1e-6)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_mode_may_change_at_a_stage_boundary_because_the_set_point_jumps(scheme):
    m = setpoint.build()
    solve(transform(m, nfe=4, scheme=scheme, piecewise_constant=[m.u]))
    assert m.x[1].value == pytest.approx(setpoint.MIDDLE, abs=1e-9)
    assert m.x[2].value == pytest.approx(setpoint.FINAL, abs=1e-9)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(setpoint.SWITCH, abs=1e-9)


def test_a_control_that_is_fixed_needs_no_equation():
    m = held_control.build()
    m.end.deactivate()
    m.u.fix(1)
    transform(m, nfe=2, ncp=1, piecewise_constant=[m.u])
    assert len(m.component('_pyomo_fesd_elements_t').held) == 0


@pytest.mark.parametrize('scheme, times', [(RADAU, 8), (LEGENDRE, 12)])
def test_every_time_but_the_end_of_a_stage_costs_one_equation(scheme, times):
    m = held_control.build()
    transform(m, nfe=4, ncp=2, scheme=scheme, piecewise_constant=[m.u])
    assert len(m.t) == times + 1
    assert len(m.component('_pyomo_fesd_elements_t').held) == len(m.t) - 2


@pytest.mark.parametrize('shape', ['scalar', 'indexed', 'expression'])
def test_what_is_not_over_time_cannot_be_held(shape):
    m = dcs(held_control.build())
    m.v = {'scalar': pyo.Var(), 'indexed': pyo.Var([1, 2]), 'expression': pyo.Expression(expr=1)}[shape]
    before = seen(m)
    with pytest.raises(FesdError, match="v: piecewise_constant: this is not indexed by 't'"):
        move(m, nfe=6, piecewise_constant=[m.u, m.v])
    assert seen(m) == before
