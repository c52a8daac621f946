"""Numbers that depend on time labels are wrong once elements move: they are named, and nothing else is."""

import gas_liquid_tank
import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from tests.models import dcs
from tests.problems import clock, crossing, held_control, sliding, weir
from tests.problems.running import LEGENDRE, RADAU, move

PLACES = pytest.mark.parametrize('scheme, ncp', [(RADAU, 1), (RADAU, 3), (LEGENDRE, 1), (LEGENDRE, 2)])


def warned(m, caplog, **keywords):
    """Names of the components that are warned of when the elements are made movable."""
    move(dcs(m), **keywords)
    found = [r for r in caplog.records if 'depend on the time label' in r.message]
    assert all(r.name == 'pyomo_fesd' and r.levelname == 'WARNING' and 'clock state' in r.message for r in found)
    return [r.message.split(':')[0] for r in found]


def signum_with(rule):
    """Signum and a further equation ``rule(m, t)`` for a variable y and its helpers x, z, and p = t^2."""
    m = signum.build()
    m.y, m.z = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=2)
    m.p = pyo.Param(m.t, default=lambda m, t: t**2)
    m.extra = pyo.Constraint(m.t, rule=rule)
    return m


@PLACES
def test_time_in_a_rule_is_named(scheme, ncp, caplog):
    m = signum_with(lambda m, t: m.y[t] == 2 * t)
    assert warned(m, caplog, scheme=scheme, ncp=ncp) == ['extra']


@PLACES
def test_a_param_over_time_is_named(scheme, ncp, caplog):
    m = signum_with(lambda m, t: m.y[t] == m.p[t] * m.x[t])
    assert warned(m, caplog, scheme=scheme, ncp=ncp) == ['extra']


def test_a_mutable_param_over_time_is_named(caplog):
    m = signum.build()
    m.y = pyo.Var(m.t, initialize=1)
    m.p = pyo.Param(m.t, default=lambda m, t: t, mutable=True)
    m.extra = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] <= m.p[t])
    assert warned(m, caplog) == ['extra']


def test_an_inequality_with_time_is_named(caplog):
    assert warned(signum_with(lambda m, t: m.y[t] <= 1 + t), caplog) == ['extra']
    caplog.clear()
    assert warned(signum_with(lambda m, t: pyo.inequality(t, m.y[t], 10)), caplog) == ['extra']


def test_bounds_that_open_with_time_are_named(caplog):
    assert warned(signum_with(lambda m, t: pyo.inequality(-t, m.y[t], t)), caplog) == ['extra']


def test_time_in_front_of_a_difference_of_variables_is_named(caplog):
    assert warned(signum_with(lambda m, t: m.y[t] == t * (m.x[t] - m.z[t])), caplog) == ['extra']


def test_time_in_a_nested_block_is_named(caplog):
    m = signum.build()

    @m.Block(['a'])
    def unit(u, name):
        u.y = pyo.Var(m.t, [1, 2])
        u.ramp = pyo.Constraint([1, 2], m.t, rule=lambda u, i, t: u.y[t, i] == i * t)

    found = warned(m, caplog)
    assert found and all(name.startswith('unit[a].ramp') for name in found)


def test_time_in_the_equation_of_a_mode_is_named(caplog):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=-2)
    m.dx = dae.DerivativeVar(m.x)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3 + t], [m.x[t] >= 0, m.dx[t] == 1]])
    assert any('sgn' in name for name in warned(m, caplog))


def test_time_in_the_region_of_a_mode_is_named(caplog):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=-2)
    m.dx = dae.DerivativeVar(m.x)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= t, m.dx[t] == 3], [m.x[t] >= t, m.dx[t] == 1]])
    assert any('sgn' in name for name in warned(m, caplog))


def test_time_in_a_complementarity_is_named(caplog):
    m = weir.build()
    m.del_component(m.overflow)
    m.overflow = Complementarity(m.t, rule=lambda m, t: complements(1 + t - m.V[t] >= 0, m.F[t] >= 0))
    assert warned(m, caplog) == ['overflow']


def test_time_in_an_integrand_is_named(caplog):
    m = signum.build()
    m.integral = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: t * m.x[t])
    m.cost = pyo.Objective(expr=m.integral)
    assert warned(m, caplog) == ['integral']


def test_time_in_an_indexed_integrand_is_named(caplog):
    m = signum.build()
    m.moment = dae.Integral(m.t, [1, 2], wrt=m.t, rule=lambda m, t, k: t**k * m.x[t])
    m.cost = pyo.Objective(expr=m.moment[1])
    found = warned(m, caplog)
    assert found and all(name.startswith('moment') for name in found)


@PLACES
@pytest.mark.parametrize(
    'build',
    [
        signum.build,
        gas_liquid_tank.build,
        gas_liquid_tank.build_in_blocks,
        gas_liquid_tank.build_eliminated,
        oscillator.build,
        clock.build,
        crossing.build,
        sliding.build,
        held_control.build,
        weir.build,
    ],
    ids=lambda f: f'{f.__module__.split(".")[-1]}.{f.__name__}',
)
def test_models_without_explicit_time_are_not_warned_of(build, scheme, ncp, caplog):
    assert warned(build(), caplog, scheme=scheme, ncp=ncp) == []


def test_a_rule_that_only_skips_the_first_time_is_not_warned_of(caplog):
    m = signum_with(lambda m, t: pyo.Constraint.Skip if t == 0 else m.y[t] == 2 * m.x[t])
    assert warned(m, caplog) == []


def test_an_inactive_equation_is_not_warned_of(caplog):
    m = signum_with(lambda m, t: m.y[t] == 2 * t)
    m.extra.deactivate()
    assert warned(m, caplog) == []


@pytest.mark.parametrize(
    'rule',
    [
        lambda m, t: m.y[t] == pyo.log(m.x[t] - 5),
        lambda m, t: m.y[t] == pyo.sqrt(m.x[t] - 5),
        lambda m, t: m.y[t] == (m.x[t] - 5) ** 0.5,
        lambda m, t: m.y[t] == 1 / (m.x[t] - m.z[t]),
        lambda m, t: m.y[t] == (m.x[t] - m.z[t]) / pyo.log(m.x[t] / m.z[t]),
        lambda m, t: m.y[t] == pyo.exp(1e6 * m.x[t] ** 2),
    ],
    ids=['logarithm', 'root', 'power', 'quotient', 'logarithmic mean', 'overflow'],
)
def test_an_equation_that_has_no_value_at_the_trial_point_does_no_harm(rule, caplog):
    assert warned(signum_with(rule), caplog) == []


def test_values_and_flags_of_the_variables_stay_as_they_were():
    m = dcs(signum_with(lambda m, t: m.y[t] == 2 * t * m.x[t]))
    before = {v.name: (v.value, v.fixed) for v in m.component_data_objects(pyo.Var)}
    move(m)
    after = {v.name: (v.value, v.fixed) for v in m.component_data_objects(pyo.Var)}
    assert before == {name: after[name] for name in before}


def test_time_in_one_of_several_integrands_is_named_with_its_index(caplog):
    m = signum.build()
    m.moment = dae.Integral([0, 1, 2], m.t, wrt=m.t, rule=lambda m, k, t: t**k * m.x[t])
    m.cost = pyo.Objective(expr=m.moment[0])
    assert warned(m, caplog) == ['moment[1]', 'moment[2]']


def test_values_that_change_from_stage_to_stage_are_not_warned_of(caplog):
    m = signum.build()
    m.t.add(1)
    m.p = pyo.Param(m.t, mutable=True, initialize={1: 2.0, 2: 5.0})
    m.y = pyo.Var(m.t, initialize=1)
    m.extra = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == m.p[t] * m.x[t])
    assert warned(m, caplog, piecewise_constant=[m.p]) == []


def impact(guard, value_after):
    """A body that moves down at speed 1 from height 1, with a jump of its speed."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.q, m.v = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=-1)
    m.dq, m.dv = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v)
    m.q[0].fix(1)
    m.v[0].fix(-1)
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.free = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == 0)
    m.impact = pyomo_fesd.state_jump(m.t, guard=guard, reset=lambda m, t: [(m.v[t], value_after(m, t))])
    return m


@PLACES
def test_time_in_a_guard_is_named(scheme, ncp, caplog):
    m = impact(lambda m, t: m.q[t] - t / 2, lambda m, t: -m.v[t])
    assert warned(m, caplog, scheme=scheme, ncp=ncp) == ['impact']


@PLACES
def test_time_in_a_reset_is_named(scheme, ncp, caplog):
    m = impact(lambda m, t: m.q[t] - 0.5, lambda m, t: t)
    assert warned(m, caplog, scheme=scheme, ncp=ncp) == ['impact']


def test_a_jump_without_time_is_not_warned_of(caplog):
    assert warned(impact(lambda m, t: m.q[t] - 0.5, lambda m, t: -m.v[t]), caplog) == []


def relay(rises):
    """A relay with hysteresis that switches off where x has risen to ``rises(t)``."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 5))
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.relay = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= rises(t), m.dx[t] == 1], [m.x[t] >= -1, m.dx[t] == -1]])
    pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.relay])
    return m


@PLACES
def test_time_in_a_hysteresis_condition_is_named(scheme, ncp, caplog):
    move(relay(lambda t: 1 + t / 10), scheme=scheme, ncp=ncp)
    assert [r.message.split(':')[0] for r in caplog.records] == ['relay']


def test_a_hysteresis_condition_without_time_is_not_warned_of(caplog):
    move(relay(lambda t: 1))
    assert not caplog.records


@pytest.mark.parametrize('scale', [1e-9, 1.0, 1e9])
@pytest.mark.parametrize(
    'rule',
    [
        lambda m, t, s: m.y[t] == m.x[t] + s * t,
        lambda m, t, s: m.y[t] == s * t * pyo.log(m.x[t] - 500),
        lambda m, t, s: m.y[t] == s * t / (m.x[t] - m.z[t]),
        lambda m, t, s: m.y[t] ** 2 <= s * pyo.sqrt(m.x[t] * m.z[t] - 200) + s * 1e-3 * t,
    ],
    ids=['small', 'logarithm', 'quotient', 'root'],
)
def test_time_is_found_whatever_its_size_and_where_it_has_no_value(rule, scale, caplog):
    assert warned(signum_with(lambda m, t: rule(m, t, scale)), caplog) == ['extra']
