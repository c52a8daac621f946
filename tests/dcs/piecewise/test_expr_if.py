"""Expr_if over time, by the multiplier of two modes (theory, eq. 5)."""

from math import atanh, log, tanh

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.core.expr import Expr_ifExpression
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import contains_node
from pyomo_fesd.core.complementarity import read_complementarity
from tests.models import collocate, dcs, snapshot, solution
from tests.problems.pieces import BENT, HOLDING, JUMPING, STAIRS, by_conditions, exact, states
from tests.problems.running import run, solve, transform

fesd_dcs = pyo.TransformationFactory('fesd.dcs')


def generated(m, ctype):
    return [c for c in m.component_data_objects(ctype, descend_into=pyo.Block) if '_pyomo_fesd_surfaces.' in c.name]


def counts(m):
    """Generated variables, constraints and pairs at one time."""
    return [len(generated(m, ctype)) / len(m.t) for ctype in (pyo.Var, pyo.Constraint, Complementarity)]


def ode(rate, x0=-2.0, end=2.0, lowest=-5, highest=5):
    """dx/dt = rate(m, t), with a second state y that rises at rate 1."""
    m = states(x0, end, lowest, highest)
    m.y = pyo.Var(m.t, initialize=0.0)
    m.dy = dae.DerivativeVar(m.y)
    m.y[0].fix(0)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == rate(m, t))
    return m


def settle(m):
    """Give every generated variable the value that belongs to the present states."""
    for block in m.component_data_objects(pyo.Block, descend_into=True):
        for switching in (block.component('switching') or {}).values():
            p, n, alpha = (block.component(name)[switching.index()] for name in ('p', 'n', 'alpha'))
            n.value = 0
            c = solution(switching, p)
            p.value, n.value, alpha.value = max(c, 0), max(-c, 0), float(c > 0)
        for condition in (block.complementarity if block.component('s') is not None else {}).values():
            s = block.s[condition.index()]
            s.value = 0
            s.value = max(0, -pyo.value(read_complementarity(condition).H))


# One condition


def value_at(m, x, y=0.0):
    """The right-hand side of the image of the ode at a state."""
    m.x[0].value, m.y[0].value, m.dx[0].value = x, y, 0.0
    settle(m)
    (image,) = fesd_dcs.get_transformed_constraints(m.ode[0])
    return pyo.value(image.upper) - pyo.value(image.body)


CONDITIONS = {
    'x >= a': lambda m, t: m.x[t] >= 1,
    'a <= x': lambda m, t: 1 <= m.x[t],
    'x > a': lambda m, t: m.x[t] > 1,
    'x <= a': lambda m, t: m.x[t] <= 1,
    'x < a': lambda m, t: m.x[t] < 1,
    'a - x <= 0': lambda m, t: 1 - m.x[t] <= 0,
    'x <= y': lambda m, t: m.x[t] <= m.y[t],
    'x - y > 1': lambda m, t: 2 * (m.x[t] - m.y[t]) > 2,
    'product': lambda m, t: m.x[t] * (m.y[t] + 1) >= 1,
    'range': lambda m, t: pyo.inequality(-1, m.x[t], 1),
    'strict range': lambda m, t: pyo.inequality(-1, m.x[t], 1, strict=True),
    'and': lambda m, t: pyo.land(m.x[t] >= 1, m.y[t] <= 2),
    'or': lambda m, t: pyo.lor(m.x[t] >= 1, m.y[t] <= 2),
    'not': lambda m, t: pyo.lnot(pyo.lor(m.x[t] >= 1, m.y[t] <= 2)),
}


points = st.lists(st.tuples(*[st.floats(-4, 4).map(lambda x: round(x, 2))] * 2), min_size=30, max_size=30)


@pytest.mark.parametrize('condition', CONDITIONS.values(), ids=CONDITIONS.keys())
@settings(max_examples=2, deadline=None)
@given(points)
def test_every_condition_means_what_pyomo_means(condition, points):
    m = ode(lambda m, t: pyo.Expr_if(condition(m, t), m.x[t] + 3, m.y[t] ** 2))
    transformed = fesd_dcs.create_using(m)
    for x, y in points:
        m.x[0].value, m.y[0].value = x, y
        on_the_surface = abs(x) == 1 or x == y or x == y + 1 or x * (y + 1) == 1 or y == 2
        if not on_the_surface:
            assert value_at(transformed, x, y) == pytest.approx(pyo.value(m.ode[0].expr.args[1]), abs=1e-9)


@pytest.mark.parametrize('written', ['x <= 1', 'x - 1 <= 0', '3 >= 3*x', 'x < 1'])
def test_a_condition_costs_three_variables_one_equation_and_two_pairs(written):
    m = ode(lambda m, t: pyo.Expr_if(eval(written, {'x': m.x[t]}), 3, 1))
    assert counts(dcs(m)) == [3, 1, 2]


def test_conditions_on_one_surface_share_their_multiplier():
    m = ode(lambda m, t: pyo.Expr_if(m.x[t] * m.y[t] <= 1, 3, 1))
    m.z = pyo.Var(m.t)
    m.one = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] >= pyo.Expr_if(2 < 2 * m.y[t] * m.x[t], m.x[t], 5))
    m.two = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] <= 9 + pyo.Expr_if(-m.x[t] * m.y[t] >= -1, 1, m.y[t]))
    assert counts(dcs(m)) == [3, 1, 2]


def test_conditions_with_parameters_are_not_joined_by_their_present_values():
    m = states(0, 1, -5, 5)
    m.limit = pyo.Param(mutable=True, initialize=1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == pyo.Expr_if(m.x[t] <= m.limit, 3, 1) + pyo.Expr_if(m.x[t] <= 1, 3, 1))
    assert counts(dcs(m)) == [6, 2, 4]


def test_a_parameter_in_a_condition_may_be_changed_afterwards():
    m = states(-2.0, 2, -5, 5)
    m.limit = pyo.Param(mutable=True, initialize=1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == pyo.Expr_if(m.x[t] <= m.limit, 3, 1))
    transform(m, 6, 2)
    for limit, end in ((1, 2), (0, 4 / 3)):
        m.limit.value = limit
        solve(m)
        assert m.x[2].value == pytest.approx(end, abs=1e-9)


def test_what_does_not_jump_is_a_kink():
    m = dcs(ode(lambda m, t: pyo.Expr_if(m.x[t] >= 1, 2 * m.x[t] - 1, m.x[t])))
    assert counts(m) == [1, 0, 1]
    assert [value_at(m, x) for x in (0.0, 1.0, 3.0)] == pytest.approx([0, 1, 5])
    m = dcs(ode(lambda m, t: pyo.Expr_if(m.x[t] <= 0, -m.x[t], m.x[t])))
    assert counts(m) == [1, 0, 1]
    assert [value_at(m, x) for x in (-2.0, 3.0)] == pytest.approx([2, 3])


def test_equal_branches_leave_nothing():
    assert counts(dcs(ode(lambda m, t: pyo.Expr_if(m.x[t] >= 1, 2, 2)))) == [0, 0, 0]


def test_a_condition_without_variables_is_evaluated_each_time_that_the_model_is_solved():
    m = states(0.0, 1)
    m.wet = pyo.Param(mutable=True, initialize=1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == pyo.Expr_if(m.wet >= 1, pyo.Expr_if(m.x[t] >= 0.5, 1, 2), 3))
    transform(m, 4, 2)
    for wet, end in ((1, 0.5 + 0.75), (0, 3)):
        m.wet.value = wet
        solve(m)
        assert m.x[1].value == pytest.approx(end, abs=1e-9)


# Where it stands


def test_the_constraint_is_replaced_by_its_image():
    m = dcs(ode(lambda m, t: pyo.Expr_if(m.x[t] <= 1, 3, 1)))
    assert not any(c.active for c in m.ode.values()) and all(c.active for c in m._pyomo_fesd_replaced.ode.values())
    assert fesd_dcs.get_src_constraint(m._pyomo_fesd_replaced.ode[0]) == [m.ode[0]]
    assert fesd_dcs.get_transformed_constraints(m.ode[0]) == [m._pyomo_fesd_replaced.ode[0]]
    assert fesd_dcs.get_transformed_constraints(m.clock[0]) == []


def test_inequalities_and_ranges_keep_their_bounds():
    m = ode(lambda m, t: 0)
    m.c = pyo.Constraint(m.t, rule=lambda m, t: (-1, pyo.Expr_if(m.x[t] <= 1, 3, 1) - m.y[t], 2))
    m.d = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] <= pyo.Expr_if(m.x[t] <= 1, 3, 1))
    dcs(m)
    for image, bounds in ((m._pyomo_fesd_replaced.c[0], (-1, 2)), (m._pyomo_fesd_replaced.d[0], (None, 0))):
        assert (image.lower, image.upper) == bounds


def test_a_named_expression_is_changed_in_place_for_all_who_use_it():
    m = ode(lambda m, t: 0)
    m.ode.deactivate()
    m.e = pyo.Expression(m.t, rule=lambda m, t: pyo.Expr_if(m.x[t] <= 1, 3, 1))
    m.f = pyo.Expression(m.t, rule=lambda m, t: 1 + m.e[t])
    m.one = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.e[t])
    m.two = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] <= 10 * m.f[t])
    dcs(m)
    assert counts(m) == [3, 1, 2]
    assert all(c.active for c in (*m.one.values(), *m.two.values()))
    assert m.component('_pyomo_fesd_replaced') is None


def test_a_condition_belongs_to_the_time_of_its_variables():
    m = ode(lambda m, t: 0)
    m.e = pyo.Expression(m.t, rule=lambda m, t: pyo.Expr_if(m.x[t] <= 1, 3, 1))
    m.c = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] <= 5 + m.e[0] + pyo.Expr_if(m.x[2] <= 1, 3, 1))
    dcs(m)
    assert [v.index() for v in m._pyomo_fesd_surfaces.x.step.alpha.values()] == [(0, 1.0), (2, 1.0)]
    assert [c.name for c in identify_variables(m.e[0].expr)] == ['_pyomo_fesd_surfaces.x.step.alpha[0,1.0]']


def test_an_objective_keeps_its_name():
    m = ode(lambda m, t: pyo.Expr_if(m.x[t] <= 1, 3, 1))
    m.goal = pyo.Objective(expr=m.x[2] + pyo.Expr_if(m.y[2] >= 1, 5, 7))
    run(m, 8, 2)
    assert pyo.value(m.goal) == pytest.approx(m.x[2].value + 5)


def test_an_integrand_may_be_conditional():
    m = ode(lambda m, t: 1, x0=-1.0)
    m.J = dae.Integral(m.t, rule=lambda m, t: pyo.Expr_if(m.x[t] <= 0, m.x[t] ** 2, 3))
    m.goal = pyo.Objective(expr=m.J)
    run(m, 4, 2)
    assert pyo.value(m.goal) == pytest.approx(1 / 3 + 3, abs=1e-9)


def test_in_the_branches_of_another_one():
    def rate(m, t):
        return pyo.Expr_if(m.x[t] <= 0, 1 - pyo.Expr_if(m.y[t] > 1.5, 5, 4), pyo.Expr_if(m.y[t] <= 1.5, 2, m.x[t]))

    m = dcs(ode(rate))
    assert counts(m) == [6, 2, 4]
    for x, y in ((-2, 0.5), (-2, 1.7), (2, 0.5), (3, 1.7)):
        expected = 1 - (5 if y > 1.5 else 4) if x <= 0 else 2 if y <= 1.5 else x
        assert value_at(m, x, y) == pytest.approx(expected)


# Whole paths


@pytest.mark.parametrize(
    'table, tolerance',
    [(BENT, 3e-6), (JUMPING, 3e-6), (HOLDING, 1e-9), (STAIRS, 1e-9)],
    ids=['bent', 'jumping', 'holding', 'stairs'],
)
@pytest.mark.parametrize('discretised', [False, True])
def test_the_solution_is_exact_to_the_order_of_the_scheme(table, tolerance, discretised):
    if discretised:
        m = dcs(by_conditions(table, 0.5, 1.5, collocate=lambda m: collocate(m, 8, 3)))
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m)
        solve(m)
    else:
        m = run(by_conditions(table, 0.5, 1.5), 8, 3)
    x, met = exact(table, 0.5, 1.5)
    assert m.x[1.5].value == pytest.approx(x, abs=tolerance)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(met, abs=tolerance)


def test_a_slide_gives_the_share_of_each_branch():
    m = run(ode(lambda m, t: pyo.Expr_if(m.x[t] <= 0, 3, -1)), 6, 2)
    assert [str(s) for s in pyomo_fesd.switches(m)] == ['time 0.6666666667: x = 0  below -> sliding below | above']
    assert m._pyomo_fesd_surfaces.x.step.alpha[2, 0.0].value == pytest.approx(3 / 4)


def test_friction_factor_of_a_pipe_that_starts_up():
    """dv/dt = a - f v^2: laminar, f = 1150/Re is linear drag; turbulent, f jumps to a constant and v tends to sqrt(a/f)."""
    a, critical, turbulent = 3.0, 2.0, 0.6  # Re = 2300 at v = 2, where f is 0.5 before
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.v, m.Re, m.f = (pyo.Var(m.t, initialize=0.5, bounds=(1e-3, None)) for _ in range(3))
    m.dv = dae.DerivativeVar(m.v)
    m.v[0].fix(0.5)
    m.reynolds = pyo.Constraint(m.t, rule=lambda m, t: m.Re[t] == 1150 * m.v[t])
    m.friction = pyo.Constraint(m.t, rule=lambda m, t: m.f[t] == pyo.Expr_if(m.Re[t] <= 2300, 1150 / m.Re[t], turbulent))
    m.momentum = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == a - m.f[t] * m.v[t] ** 2)
    run(m, 10, 3)
    met = log((a - 0.5) / (a - critical))
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(met, abs=1e-6)
    assert switch.disjunction == 'Re = 2300'
    w = (a / turbulent) ** 0.5
    rest = 2 - met
    u = atanh(critical / w) + rest * (a * turbulent) ** 0.5
    assert m.v[2].value == pytest.approx(w * tanh(u), abs=1e-6)


def test_inside_a_disjunct():
    m = states(0.2, 2)
    m.mode = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] <= 1, m.dx[t] == pyo.Expr_if(m.x[t] <= 0.5, 1, 2)],
            [m.x[t] >= 1, m.dx[t] == 0.5],
        ],
    )
    run(m, 8, 2)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([0.3, 0.55], abs=1e-9)
    (image,) = fesd_dcs.get_transformed_constraints(m.mode[0].disjuncts[0].constraint[2])
    assert fesd_dcs.get_src_constraint(image)[0] is m.mode[0].disjuncts[0].constraint[2]


def test_inside_a_disjunct_at_some_of_the_further_times():
    """Disjuncts that are built like known ones are not searched; those that are not, are."""
    m = states(-2.0, 2.0, -5, 5)
    m.z = pyo.Var(m.t)

    @m.Disjunct(m.t)
    def below(d, t):
        m, rate = d.model(), d.model().x[t] + 3
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.z = pyo.Constraint(expr=m.z[t] == (rate if t < 1 else pyo.Expr_if(IF=m.x[t] >= -1, THEN=rate, ELSE=1 + rate)))

    @m.Disjunct(m.t)
    def above(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        d.z = pyo.Constraint(expr=m.z[t] == 1)

    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.z[t])
    m.mode = Disjunction(m.t, rule=lambda m, t: [m.below[t], m.above[t]])
    transform(m, 4, 2)
    rows = [c for c in m.component_data_objects(pyo.Constraint, active=True, descend_into=pyo.Block)]
    assert not any(contains_node(c.expr, frozenset([Expr_ifExpression])) for c in rows)
    assert {c.index()[0] for c in generated(m, pyo.Constraint)} == {t for t in m.t if t >= 1}


# What is refused


def conditional(condition):
    return lambda: ode(lambda m, t: pyo.Expr_if(condition(m, t), 3, 1))


def own_value():
    m = ode(lambda m, t: 0)
    m.F = pyo.Var(m.t)
    m.own = pyo.Constraint(m.t, rule=lambda m, t: m.F[t] == pyo.Expr_if(m.F[t] >= 1, 3, 1))
    return m


def in_a_complementarity():
    m = ode(lambda m, t: 0)
    m.c = Complementarity(m.t, rule=lambda m, t: complements(m.x[t] >= pyo.Expr_if(m.x[t] >= 1, 3, 1), m.y[t] >= 0))
    return m


REFUSED = {
    'an equation': (conditional(lambda m, t: m.x[t] == 1), 'ode[0]', 'is not an inequality'),
    'a number': (conditional(lambda m, t: m.x[t]), 'ode[0]', 'is not an inequality'),
    'an empty range': (conditional(lambda m, t: pyo.inequality(1, m.x[t], 1)), 'ode[0]', 'is empty'),
    'a derivative': (conditional(lambda m, t: m.dy[t] >= 1), 'ode[0]', "contains the derivative 'dy[0]'"),
    'a jump': (
        conditional(lambda m, t: m.x[t] + pyo.Expr_if(m.y[t] <= 1, 0, 1) <= 0),
        'ode[0]',
        'contains a function that jumps',
    ),
    'what it defines': (own_value, 'own[0]', "contains 'F[0]', which it defines itself"),
    'a complementarity': (in_a_complementarity, 'c[0]', 'contains an Expr_if'),
}


@pytest.mark.parametrize('build, name, cause', REFUSED.values(), ids=REFUSED.keys())
def test_what_is_refused_is_named_and_the_model_is_as_it_was(build, name, cause):
    m = build()
    before = snapshot(m)
    with pytest.raises(FesdError) as error:
        dcs(m)
    assert error.value.component == name and cause in error.value.cause
    assert snapshot(m) == before


def test_without_time_it_is_left_to_the_solver_which_refuses_it():
    m = ode(lambda m, t: 1)
    m.size = pyo.Var()
    m.cost = pyo.Constraint(expr=m.size >= pyo.Expr_if(m.size >= 1, 3, 1))
    transform(m, 2, 2)
    with pytest.raises(FesdError, match='cost: .*Expr_if'):
        solve(m)
