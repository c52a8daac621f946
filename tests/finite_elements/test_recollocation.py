"""More points in the elements of a model discretised with BACKWARD differences: the model that Radau points would have given."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunction

import pyomo_fesd
from tests.problems.running import seen, solve

END = 2.0


def decay(differences=True, nfe=4, switched=False):
    """x' = -y, y = x, z' = u; a balance that is switched off at the first time, and an equation without a time."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, END))
    m.x, m.y, m.z = pyo.Var(m.t, initialize=1.0), pyo.Var(m.t, initialize=1.0, bounds=(0, 9)), pyo.Var(m.t, initialize=0.0)
    m.u = pyo.Var(m.t, initialize=1.0)
    m.dx, m.dz = dae.DerivativeVar(m.x), dae.DerivativeVar(m.z)
    m.off = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == 17)
    m.gone = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == 18)
    m.side = pyo.Block(m.t, rule=lambda b, t: b.add_component('v', pyo.Var(initialize=3)))
    m.equal = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == m.x[t])
    m.slope = pyo.Constraint(m.t, rule=lambda m, t: m.dz[t] == m.u[t])
    m.area = dae.Integral(m.t, rule=lambda m, t: m.x[t])
    if not switched:
        m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -m.y[t])
    m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
    if differences:
        pyo.TransformationFactory('dae.finite_difference').apply_to(m, nfe=nfe, scheme='BACKWARD')
    else:
        pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=nfe, ncp=3)
    if switched:
        m.modes = Disjunction(m.t, rule=lambda m, t: [[m.x[t] >= 0.5, m.dx[t] == -1], [m.x[t] <= 0.5, m.dx[t] == -0.25]])
    m.off.deactivate()
    for t in m.t:
        del m.gone[t]
        m.u[t].fix(2.0)
        m.side[t].v.fix(3)
        m.scaling_factor[m.x[t]] = 10
    m.x[0].fix(1.0)
    m.z[0].fix(0.0)
    return m


def radau_3(z):
    """The stability function of Radau with three points."""
    return (1 + 2 / 5 * z + z**2 / 20) / (1 - 3 / 5 * z + 3 / 20 * z**2 - z**3 / 60)


def test_the_model_is_that_of_collocation_from_the_beginning():
    m, other = decay(), decay(differences=False)
    pyomo_fesd.recollocate(m, ncp=3)
    assert list(m.t) == pytest.approx(list(other.t), abs=2e-6)
    active = [[c.name.split('[')[0] for c in one.component_data_objects(pyo.Constraint, active=True)] for one in (m, other)]
    assert sorted(active[0]) == sorted(active[1])
    for one in (m, other):
        pyo.assert_optimal_termination(pyo.SolverFactory('casadi_ipopt').solve(one))
    assert m.x[END].value == pytest.approx(other.x[END].value, abs=1e-7)
    assert m.x[END].value == pytest.approx(radau_3(-0.5) ** 4, abs=1e-9)
    assert pyo.value(m.area) == pytest.approx(pyo.value(other.area), abs=1e-6)


def test_values_are_interpolated_and_flags_bounds_and_factors_copied():
    m = decay()
    for t in m.t:
        m.x[t].value = m.y[t].value = 3 * t
    m.y[END].setub(5)
    old = list(m.t)
    pyomo_fesd.recollocate(m, ncp=2)
    new = [t for t in m.t if t not in old]
    assert len(new) == 4
    for t in new:
        assert m.x[t].value == pytest.approx(3 * t) and not m.x[t].fixed and m.scaling_factor[m.x[t]] == 10
        assert m.u[t].fixed and m.u[t].value == 2 and m.side[t].v.fixed
    assert m.y[new[-1]].ub == 5 and m.y[new[0]].ub == 9
    assert not any(c.active for c in m.off.values()) and not len(m.gone)


def test_inputs_with_several_values_are_held_over_their_elements_and_this_is_said(caplog):
    m = decay()
    for t in m.t:
        m.u[t].fix(1.0 if t <= 1 else 4.0)
    pyomo_fesd.recollocate(m, ncp=3)
    assert {m.u[t].value for t in m.t if t > 1} == {4.0} and {m.u[t].value for t in m.t if t <= 1} == {1.0}
    assert 'held in each element' in caplog.text and caplog.text.rstrip().endswith('u[*]')


def test_equations_that_idaes_scaled_in_place_are_scaled_at_all_points(caplog):
    m = decay(switched=True)
    m.constraint_transformed_scaling_factor = pyo.Suffix()
    for c in (*m.equal.values(), *m.dx_disc_eq.values()):
        c.set_value(c.body * 100 == c.upper * 100)
        m.constraint_transformed_scaling_factor[c] = 100
    pyomo_fesd.recollocate(m, ncp=2)
    for v in m.component_data_objects(pyo.Var):
        if not v.fixed:
            v.set_value(0.25)
    for family in (m.equal, m.dx_disc_eq):
        assert all(c in m.constraint_transformed_scaling_factor for c in family.values())
        assert {len(str(c.expr).split('100')) > 1 for c in family.values()} == {True}
    move(m)
    assert 'its numbers depend on the time label' not in caplog.text


def test_discretised_first_and_switched_later_the_switch_is_exact():
    m = decay(switched=True)
    pyomo_fesd.recollocate(m, ncp=2)
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m)
    pyomo_fesd.simulate(m)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(0.5, abs=1e-9)
    solve(m, warm_start=True)
    assert m.x[END].value == pytest.approx(0.5 - 0.25 * 1.5, abs=1e-9)


def move(m, **keywords):
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, **keywords)


REFUSED = {
    'not discretised': (lambda m: None, {}, "it is not discretised"),
    'central': (
        lambda m: pyo.TransformationFactory('dae.finite_difference').apply_to(m, nfe=4, scheme='CENTRAL'),
        {},
        "not with one point",
    ),
    'two points': (lambda m: pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=4, ncp=2), {}, "not with one point"),
    'movable': (
        lambda m: pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=4, ncp=1),
        {},
        "movable already",
    ),
    'a number': (
        lambda m: pyo.TransformationFactory('dae.finite_difference').apply_to(m, nfe=4, scheme='BACKWARD'),
        {'ncp': 0},
        "not an integer from 1 to 12",
    ),
}


@pytest.mark.parametrize('prepare, keywords, message', REFUSED.values(), ids=list(REFUSED))
def test_other_grids_are_refused_and_the_model_is_as_before(prepare, keywords, message):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    m.c = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1)
    prepare(m)
    before = seen(m)
    with pytest.raises(pyomo_fesd.FesdError, match=message):
        pyomo_fesd.recollocate(m, **keywords)
    assert seen(m) == before


def test_a_rule_that_fails_at_a_new_time_leaves_the_model_as_it_was():
    m = decay()
    known = list(m.t)
    data = dict.fromkeys(known, 1.0)
    m.late = pyo.Constraint(m.t, rule=lambda m, t: m.x[t] <= data[t] + 9)
    m.u[1.0].fix(9.0)
    before, expression = seen(m), m.dx.get_derivative_expression()
    with pytest.raises(pyomo_fesd.FesdError, match="a rule failed at a new time"):
        pyomo_fesd.recollocate(m)
    assert seen(m) == before and m.dx.get_derivative_expression() is expression


def test_elements_of_order_one_that_find_switches_are_named_with_the_line_that_cures_it(caplog):
    move(decay(switched=True))
    assert 'order 1' in caplog.text and 'pyomo_fesd.recollocate' in caplog.text


def test_nothing_is_said_of_other_orders_and_where_nothing_switches(caplog):
    move(decay())
    m = decay(switched=True)
    pyomo_fesd.recollocate(m)
    caplog.clear()
    move(m)
    assert 'order 1' not in caplog.text


def in_blocks():
    """x' = -x with two numbers on a Block over time, and References to them as ports have; a factor for a whole component."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, END))
    m.x = pyo.Var(m.t, initialize=1.0)
    m.dx = dae.DerivativeVar(m.x)
    m.side = pyo.Block(m.t, rule=lambda b, t: b.add_component('v', pyo.Var([1, 2], initialize=3)))
    m.port = pyo.Reference(m.side[:].v[1])
    m.ports = pyo.Reference(m.side[:].component('v')[...])
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == -m.x[t])
    m.equal = pyo.Constraint(m.t, [1, 2], rule=lambda m, t, k: m.side[t].v[k] == k * m.x[t])
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, nfe=4, scheme='BACKWARD')
    m.x[0].fix(1.0)
    m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
    for t in m.t:
        m.scaling_factor[m.side[t].v] = 10
    m.scaling_factor[m.x] = 2
    return m


def test_a_factor_for_a_whole_component_is_continued():
    m = in_blocks()
    pyomo_fesd.recollocate(m, ncp=3)
    assert len(m.t) == 13 and all(m.scaling_factor[m.side[t].v] == 10 for t in m.t) and m.scaling_factor[m.x] == 2


def test_after_a_failure_references_are_as_they_were(monkeypatch):
    m = in_blocks()
    labels, port = list(m.t), list(m.port)

    def fails(self):
        raise RuntimeError('in the middle')

    monkeypatch.setattr('pyomo_fesd.finite_elements.inner_points.InnerPoints.complete', fails)
    with pytest.raises(RuntimeError, match='in the middle'):
        pyomo_fesd.recollocate(m, ncp=3)
    assert list(m.t) == labels and list(m.port) == port and len(m.side) == len(labels)
