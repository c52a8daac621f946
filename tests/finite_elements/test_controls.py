"""Controls held constant on each control stage."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.mpec import Complementarity, complements

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


@pytest.mark.parametrize(
    'wrong, message',
    [
        (lambda m: 'u', 'u: piecewise_constant: this is a str, not a component'),
        (lambda m: [m.u, 'v'], 'v: piecewise_constant: this is a str'),
        (lambda m: m.twice, 'twice: piecewise_constant: this is a Expression'),
        (lambda m: m.constant, 'constant: piecewise_constant: this Param cannot change'),
        (lambda m: 5, 'piecewise_constant: this is a int'),
    ],
    ids=['name', 'name in a list', 'expression', 'Param', 'number'],
)
def test_what_is_no_input_cannot_be_held(wrong, message):
    m = held_control.build()
    m.twice = pyo.Expression(m.t, rule=lambda m, t: 2 * m.u[t])
    m.constant = pyo.Param(m.t, default=1)
    dcs(m)
    with pytest.raises(FesdError, match=message):
        move(m, nfe=6, piecewise_constant=wrong(m))
    assert list(m.t) == [0, 1, 2]


# Inputs that are given


def fed(points=(0, 1, 2), **param):
    """dx/dt = p with a mutable Param p over time, x(0) = 0."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    m.p = pyo.Param(m.t, mutable=True, **param)
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[points[0]].fix(0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.p[t])
    return m


def no_warning(caplog):
    return not [r for r in caplog.records if r.name == 'pyomo_fesd']


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('param', [{}, {'default': 77.0}], ids=['no default', 'default'])
def test_a_param_has_the_value_at_the_end_of_its_stage(param, scheme, caplog):
    m = fed(initialize={1: 3.0, 2: -5.0}, **param)
    solve(move(m, nfe=4, scheme=scheme, piecewise_constant=[m.p]))
    assert (m.x[1].value, m.x[2].value) == pytest.approx((3, -2), abs=1e-9)
    assert {pyo.value(m.p[t]) for t in m.t if t <= 1} == {3.0}
    assert no_warning(caplog)
    assert pyomo_fesd.report(m)['constraints'] == pyomo_fesd.report(move(fed(initialize=1.0), nfe=4, scheme=scheme))['constraints']


def test_params_with_further_indices_are_given_one_by_one():
    m = fed(initialize=0)
    m.k = pyo.Set(initialize=['a', 'b'])
    m.q = pyo.Param(m.k, m.t, mutable=True, initialize={('a', 1): 1, ('a', 2): 2, ('b', 1): 10, ('b', 2): 20})
    m.ode.deactivate()
    m.other = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.q['a', t] + m.q['b', t])
    solve(move(m, nfe=4, piecewise_constant=[m.q]))
    assert m.x[2].value == pytest.approx(33, abs=1e-9)


def test_params_on_a_grid_that_was_there_get_the_values_of_their_stages():
    m = fed(points=(0, 2), initialize={2: 0.0})
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=4, ncp=2)
    m.p[0.5] = 1.0
    m.p[2] = 4.0
    solve(move(m, stages=[0.5], piecewise_constant=[m.p]))
    assert m.x[2].value == pytest.approx(0.5 * 1 + 1.5 * 4, abs=1e-9)


def test_a_param_without_a_value_at_the_end_of_a_stage_is_refused():
    m = fed(initialize={1: 3.0})
    before = seen(m)
    with pytest.raises(FesdError, match=r'^p\[2\]: piecewise_constant: it has no value'):
        move(m, nfe=4, piecewise_constant=[m.p])
    assert seen(m) == before


@pytest.mark.parametrize('kind', ['Param', 'Var'])
def test_a_first_value_that_is_not_that_of_the_first_stage_is_refused(kind):
    m = fed(initialize={0: 2.0, 1: 3.0, 2: 4.0}) if kind == 'Param' else steered({0: 2.0, 1: 3.0, 2: 4.0})
    before = seen(m)
    with pytest.raises(FesdError, match=r"\[0\]: piecewise_constant: 2 here, but 3 at the end of this control stage"):
        move(m, nfe=4, piecewise_constant=[m.p if kind == 'Param' else m.u])
    assert seen(m) == before


def steered(values):
    """dx/dt = u, u fixed at these times."""
    m = fed(initialize=0)
    m.u = pyo.Var(m.t, initialize=9)
    m.ode.deactivate()
    m.follow = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    for t, value in values.items():
        m.u[t].fix(value)
    return m


@pytest.mark.parametrize('values', [{1: 3.0, 2: -5.0}, {0: 3.0, 1: 3.0, 2: -5.0}], ids=['ends', 'all times'])
def test_a_var_that_is_fixed_at_the_ends_is_fixed_on_its_stages(values, caplog):
    m = solve(hold(steered(values)))
    assert m.x[2].value == pytest.approx(-2, abs=1e-9)
    assert all(v.fixed for v in m.u.values())
    assert len(m.component('_pyomo_fesd_elements_t').held) == 0
    assert no_warning(caplog)


def hold(m):
    return move(m, nfe=4, piecewise_constant=[m.u])


def test_a_var_that_is_fixed_at_the_end_of_one_stage_is_free_on_the_other():
    m = hold(steered({1: 3.0}))
    m.goal = pyo.Objective(expr=(m.x[2] - 1) ** 2)
    solve(m)
    assert m.u[2].value == pytest.approx(-2, abs=1e-6)
    assert {v.value for t, v in m.u.items() if t <= 1} == {3.0}


def test_a_set_point_may_be_fixed_instead_of_stated_by_equations(caplog):
    m = setpoint.build()
    m.del_component(m.first)
    m.del_component(m.second)
    for t, value in zip((1, 2), setpoint.SETPOINTS):
        m.u[t].fix(value)
    solve(transform(m, nfe=4, piecewise_constant=[m.u]))
    assert m.x[2].value == pytest.approx(setpoint.FINAL, abs=1e-9)
    assert no_warning(caplog)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_set_point_may_be_a_param(scheme, caplog):
    m = setpoint.build_given()
    solve(transform(m, nfe=4, scheme=scheme, piecewise_constant=[m.p]))
    assert m.x[1].value == pytest.approx(setpoint.MIDDLE, abs=1e-9)
    assert m.x[2].value == pytest.approx(setpoint.FINAL, abs=1e-9)
    assert no_warning(caplog)


def test_what_was_fixed_or_given_is_as_it_was_after_a_later_error():
    m = steered({1: 3.0, 2: -5.0})
    m.p[1] = m.p[2] = 4
    m.p[0].clear()
    m.bad = Complementarity(m.t, rule=lambda m, t: complements(m.x[t], m.u[t]))
    before = seen(m)
    with pytest.raises(FesdError, match='have 0 finite bounds'):
        move(m, nfe=4, piecewise_constant=[m.u, m.p])
    assert seen(m) == before
    assert not m.u[0].fixed and m.u[0].value == 9 and pyo.value(m.p[0], exception=False) is None


# Stages of unequal length


@pytest.mark.parametrize('scheme', SCHEMES)
def test_stages_may_be_of_unequal_length(scheme):
    m = held_control.build()
    m.t.add(1.9)
    m.end.deactivate()
    m.cost.deactivate()
    solve(fix_and_move(m, scheme, 6))
    # from -4.5 at rate 3 to zero at 1.5, then at rate 1
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(1.5, abs=1e-9)
    assert m.x[2].value == pytest.approx(0.5, abs=1e-9)


def fix_and_move(m, scheme, nfe):
    for t in (1, 1.9, 2):
        m.u[t].fix(1)
    return transform(m, nfe=nfe, scheme=scheme, piecewise_constant=[m.u])


def test_stages_may_have_elements_of_their_own_number():
    m = held_control.build()
    m.t.add(1.9)
    m.end.deactivate()
    m.cost.deactivate()
    solve(fix_and_move(m, SCHEMES[0], [1, 4, 2]))
    starts = pyomo_fesd.element_lengths(m)['start']
    assert [starts[n] for n in (1, 2, 6)] == pytest.approx([0, 1, 1.9], abs=1e-12)
    assert len(starts) == 7
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(1.5, abs=1e-9)


@pytest.mark.parametrize('nfe', [[2], [2, 2, 2], []])
def test_a_list_of_numbers_must_have_one_for_each_stage(nfe):
    m = dcs(held_control.build())
    before = seen(m)
    with pytest.raises(FesdError, match='numbers for 2 control stages'):
        move(m, nfe=nfe)
    assert seen(m) == before


@pytest.mark.parametrize('nfe', [[2, 0], [2, -1], [2, 1.5], 'many'])
def test_numbers_of_elements_are_positive_integers(nfe):
    with pytest.raises(ValueError):
        move(dcs(held_control.build()), nfe=nfe)
