"""Piecewise linear functions of one argument: kinks by eq. (8), jumps by eq. (5), whoever writes them."""

from math import exp, log

import numpy as np
import pump_curve
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.contrib.piecewise import PiecewiseLinearFunction
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core.time_index import TimeIndex
from pyomo_fesd.dcs.piecewise.univariate import piecewise_linear
from pyomo_fesd.finite_elements.continuity import read_continuity
from tests.models import collocate, dcs, snapshot
from tests.problems.pieces import (
    BENT,
    HOLDING,
    JUMPING,
    RISING,
    STAIRS,
    by_function,
    by_piecewise,
    by_table,
    exact,
    functions_in_blocks,
    in_blocks,
    states,
)
from tests.problems.running import SCHEMES, run, solve, transform

WRITINGS = [by_piecewise, by_function, in_blocks, functions_in_blocks]
writings = pytest.mark.parametrize('build', WRITINGS)
fesd_dcs = pyo.TransformationFactory('fesd.dcs')


def generated(m, ctype):
    """Data of one type in generated blocks, images apart."""
    return [c for c in m.component_data_objects(ctype, descend_into=pyo.Block) if '_pyomo_fesd_surfaces.' in c.name]


def counts(m):
    """Generated variables, constraints and pairs at one time."""
    return [len(generated(m, ctype)) / len(m.t) for ctype in (pyo.Var, pyo.Constraint, Complementarity)]


class At:
    """In the place of a model: kinks and steps have the values that belong to ``x``."""

    def __init__(self, x):
        self.x = x

    def positive_part(self, q, level):
        return max(0.0, self.x - level)

    def indicator(self, q, level, sign=1):
        return float(sign * (self.x - level) > 0)


def evaluated(function, x):
    """Eq. (8) at x, with the values that its variables have there."""
    variable = pyo.Var(bounds=(function.lower, function.upper), initialize=x)
    variable.construct()
    return pyo.value(function.expression(variable, At(x)))


# The table


numbers = st.floats(-100, 100).map(lambda x: round(x, 3))
tables = st.lists(st.tuples(numbers, numbers), min_size=2, max_size=12, unique_by=lambda p: p[0]).map(sorted)


@settings(max_examples=200, deadline=None)
@given(tables, st.floats(0, 1))
def test_eq_8_is_linear_interpolation(points, share):
    x, y = zip(*points)
    where = x[0] + share * (x[-1] - x[0])
    found = evaluated(piecewise_linear(None, x, y), where)
    assert found == pytest.approx(np.interp(where, x, y), abs=1e-7 * (1 + max(map(abs, y))))


@settings(max_examples=100, deadline=None)
@given(tables, st.lists(st.booleans(), min_size=12, max_size=12), numbers, st.floats(0, 1))
def test_with_jumps_each_side_has_its_own_line(points, doubled, jump, share):
    written = [q for (x, y), twice in zip(points, doubled) for q in ([(x, y), (x, y + jump)] if twice else [(x, y)])]
    x, y = zip(*written)
    where = x[0] + share * (x[-1] - x[0])
    if where in x or where > x[-1]:  # round-off
        return
    k = next(k for k in range(len(x)) if x[k] < where < x[k + 1])
    found = evaluated(piecewise_linear(None, x, y), where)
    line = y[k] + (y[k + 1] - y[k]) / (x[k + 1] - x[k]) * (where - x[k])
    assert found == pytest.approx(line, abs=1e-7 * (1 + max(map(abs, y))))


def test_where_nothing_changes_there_is_no_breakpoint():
    function = piecewise_linear(None, [0, 1, 2, 3, 4], [0, 1, 2, 2, 2])
    assert function.breaks == ((2.0, 0.0, -1.0),)


def test_a_jump_and_a_change_of_slope_are_one_breakpoint():
    assert piecewise_linear(None, *zip(*JUMPING)).breaks == ((1.0, -2.0, -1.0),)


def test_jumps_at_the_ends_are_jumps_too():
    function = piecewise_linear(None, [0, 0, 1, 1], [0, 1, 1, 3])
    assert (function.y_0, function.m_0, function.breaks) == (0.0, 0.0, ((0.0, 1.0, 0.0), (1.0, 2.0, 0.0)))


@pytest.mark.parametrize('scale', [1e-9, 1.0, 1e9])
@pytest.mark.parametrize('offset', [0.0, 1e3])
def test_rounding_is_no_change_of_slope_and_small_changes_are(scale, offset):
    x = [offset + 0.1 * k for k in range(8)]
    straight = piecewise_linear(None, x, [scale * (3 * p + 7) for p in x])
    assert straight.breaks == ()
    bent = piecewise_linear(None, x, [scale * (3 * p + 7 + 1e-6 * max(0, p - x[4])) for p in x])
    assert [b for b, _, _ in bent.breaks] == [x[4]]


# Its size


def test_a_kink_costs_one_variable_and_one_pair():
    assert counts(dcs(by_table(BENT, 0.5, 1))) == [2, 0, 2]


def test_a_jump_costs_three_variables_and_a_change_of_slope_there_nothing_more():
    assert counts(dcs(by_function(STAIRS, 0.5, 1))) == [6, 2, 4]
    assert counts(dcs(by_function(JUMPING, 0.5, 1))) == [3, 1, 2]


def test_a_straight_table_costs_nothing():
    m = dcs(by_table(((0, 0), (1, 2), (10, 20)), 0.5, 1))
    assert counts(m) == [0, 0, 0]


@pytest.mark.parametrize('form', ['SOS2', 'CC', 'DCC', 'LOG', 'DLOG', 'MC', 'INC', 'BIGM_BIN', 'BIGM_SOS1'])
def test_no_form_of_piecewise_makes_a_difference(form):
    table = ((0, 1), (1, 3), (2, 2), (6, 2.5), (10, 1.5))  # as many segments as the logarithmic forms ask for
    m = dcs(by_piecewise(table, 0.5, 1, form=form))
    assert counts(m) == [3, 0, 3]
    assert not [b.name for b in m.f.values() if b.active]
    assert list(m._pyomo_fesd_replaced.f) == list(m.t)


def test_tables_of_the_same_argument_share_their_kinks():
    m = states(0.5, 1, 0, 2)
    m.f, m.g = (PiecewiseLinearFunction(tabular_data=dict(zip((0, 1, 2, 10), y))) for y in ((1, 3, 2, 2), (0, 1, 1, 9)))
    m.y = pyo.Var(m.t)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f(m.x[t]) + m.g(2 - m.x[t]))
    m.out = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == m.g(m.x[t]) * m.f(m.x[t]))
    dcs(m)
    # f and g bend at 1 and 2; g(2 - x) bends where x is 1 and 0
    assert counts(m) == [3, 0, 3]
    assert list(m._pyomo_fesd_surfaces.component_map()) == ['x']


@pytest.mark.parametrize('lowest, highest, rows', [(0, 10, 0), (0.1, 9, 0), (-1, 10, 1), (0, 11, 1), (None, None, 1)])
def test_the_domain_is_kept_where_bounds_do_not_keep_it(lowest, highest, rows):
    m = states(0.5, 1, lowest, highest)
    m.f = PiecewiseLinearFunction(tabular_data=dict(BENT))
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f(m.x[t]))
    dcs(m)
    assert counts(m)[1] == rows
    if rows:
        assert pyo.value(m._pyomo_fesd_surfaces.x.inside[0, 0.0, 10.0].upper) == 10


# Whole paths


@writings
@pytest.mark.parametrize('table', [BENT, JUMPING, HOLDING], ids=['bent', 'jumping', 'holding'])
def test_the_solution_and_its_switches_are_exact_to_the_order_of_the_scheme(build, table):
    m = run(build(table, 0.5, 1.5), 8, 3)
    x, met = exact(table, 0.5, 1.5)
    assert m.x[1.5].value == pytest.approx(x, abs=3e-6)
    found = pyomo_fesd.switches(m)
    assert [s.time for s in found] == pytest.approx(met, abs=1e-6)
    assert {s.before for s in found} == {'below'}
    assert found[0].disjunction == 'x = 1'


@writings
@pytest.mark.parametrize('scheme', SCHEMES)
def test_steps_of_constant_height_are_exact(build, scheme):
    m = run(build(STAIRS, 0.5, 1.5), 8, 2, scheme=scheme)
    x, met = exact(STAIRS, 0.5, 1.5)
    assert m.x[1.5].value == pytest.approx(x, abs=1e-9)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(met, abs=1e-9)


@pytest.mark.parametrize('build', [*WRITINGS, by_table])
def test_a_discretised_model_gives_the_same(build):
    first = run(build(BENT, 0.5, 1.5), 6, 2)
    m = dcs(build(BENT, 0.5, 1.5, collocate=lambda m: collocate(m, 6, 2)))
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m)
    solve(m)
    assert m.x[1.5].value == pytest.approx(first.x[1.5].value, abs=1e-8)
    assert dict(pyomo_fesd.report(m)) == dict(pyomo_fesd.report(first))


def test_where_it_slides_the_step_says_how_much_of_each_side_there_is():
    m = run(by_piecewise(HOLDING, 0.5, 1), 6, 2)
    assert pyomo_fesd.switches(m)[0].after == 'sliding below | above'
    # dx = 2 - 3 alpha = 0
    assert m._pyomo_fesd_surfaces.x.step.alpha[1, 1.0].value == pytest.approx(2 / 3)
    assert m.y[1].value == pytest.approx(0, abs=1e-8)


def slope(numbers, errors):
    return -np.polyfit(np.log(numbers), np.log(errors), 1)[0]


def test_the_order_of_radau_is_kept():
    end, _ = exact(RISING, 0.5, 1.5)
    numbers = (6, 12, 24, 48)
    errors = [abs(run(by_function(RISING, 0.5, 1.5), N, 2).x[1.5].value - end) for N in numbers]
    assert slope(numbers, errors) > 2.5


def test_a_fixed_grid_loses_the_order():
    horizon = 2 * log(1.5)  # the breakpoint is met after a quarter of it, and of an element
    end, (met,) = exact(RISING, 0.5, horizon)
    assert met == pytest.approx(horizon / 4)
    numbers = (5, 13, 45)
    models = [dcs(by_function(RISING, 0.5, horizon, lambda m, N=N: collocate(m, N, 2))) for N in numbers]
    errors = [abs(solve(m).x[horizon].value - end) for m in models]
    assert slope(numbers, errors) < 2.2


def test_the_value_of_a_bent_function_is_continuous_in_time_and_that_of_a_jumping_one_is_not():
    m = states(0.2, 3)
    m.level, m.travel, m.flow, m.alarm = (pyo.Var(m.t, initialize=0.1) for _ in range(4))
    m.controller = PiecewiseLinearFunction(tabular_data={0: 0.05, 0.3: 0.05, 0.6: 1, 10: 1})
    m.valve = PiecewiseLinearFunction(tabular_data={0: 0, 0.25: 0.1, 0.5: 0.3, 0.75: 0.6, 1: 1})
    m.bell = PiecewiseLinearFunction(simplices=[(0, 0.2), (0.2, 1)], linear_functions=[lambda x: 0 * x, lambda x: 0 * x + 1])
    m.cylinder = pyo.Constraint(m.t, rule=lambda m, t: 2 * m.level[t] == m.x[t])
    m.control = pyo.Constraint(m.t, rule=lambda m, t: m.travel[t] == m.controller(m.level[t]))
    m.characteristic = pyo.Constraint(m.t, rule=lambda m, t: m.flow[t] == m.valve(m.travel[t]))
    m.ring = pyo.Constraint(m.t, rule=lambda m, t: m.alarm[t] == m.bell(m.flow[t]))
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 0.8 - m.flow[t])
    collocate(m)
    dcs(m)
    t = m.t.at(2)
    continuity = read_continuity(m, TimeIndex(m.t), {t}, [], [], trace=True)
    assert [continuity.holds(v[t]) for v in (m.level, m.travel, m.flow, m.alarm)] == [True, True, True, False]


def test_an_implicit_equation_may_contain_the_function():
    found, (times, level, energy) = pump_curve.found(pump_curve.solve()[0]), pump_curve.exact()
    assert found[0] == pytest.approx(times, abs=1e-8)
    assert found[1:] == pytest.approx((level, energy), abs=1e-8)


def test_the_argument_of_a_kink_may_jump():
    m = states(1.0, 2, 0, 4)
    m.u, m.flow = pyo.Var(m.t, bounds=(0, 2), initialize=0.5), pyo.Var(m.t, initialize=1)
    m.relay = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1.5, m.u[t] == 0.3], [m.x[t] >= 1.5, m.u[t] == 1.2]])
    m.f = PiecewiseLinearFunction(tabular_data={0: 1, 0.5: 2, 2: 3})
    m.characteristic = pyo.Constraint(m.t, rule=lambda m, t: m.flow[t] == m.f(m.u[t]))
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 0.3 * m.flow[t])
    run(m, 8, 2)
    # f(0.3) = 1.6, f(1.2) = 2 + 0.7*2/3
    met = 0.5 / 0.48
    assert m.x[2].value == pytest.approx(1.5 + (2 - met) * 0.3 * (2 + 1.4 / 3), abs=1e-9)
    assert {s.disjunction: s.time for s in pyomo_fesd.switches(m)} == pytest.approx({'relay': met, 'u = 0.5': met}, abs=1e-9)


def test_bounds_in_optimal_control():
    """The fastest way under a limit that falls and rises again; a convex lower bound stays as Pyomo writes it."""
    m = states(0, 1)
    m.u = pyo.Var(m.t, bounds=(0, 4), initialize=1)
    rules = {'warn_domain_coverage': False}
    m.limit = pyo.Piecewise(m.t, m.u, m.x, pw_pts=[0, 1, 2, 10], f_rule=[2, 1, 3, 3], pw_constr_type='UB', **rules)
    m.least = pyo.Piecewise(m.t, m.u, m.x, pw_pts=[0, 1, 10], f_rule=[0, 0.1, 5], pw_constr_type='LB', **rules)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    m.goal = pyo.Objective(expr=m.x[1], sense=pyo.maximize)
    run(m, 6, 4)  # the optimum of the grid has one element on one side
    assert m.x[1].value == pytest.approx(1 + (exp(2 * (1 - log(2))) - 1) / 2, abs=1e-6)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([log(2)], abs=1e-6)
    assert all(b.active for b in m.least.values()) and not any(b.active for b in m.limit.values())
    assert m._pyomo_fesd_replaced.component('least') is None


def test_a_lower_bound_that_is_not_convex():
    m = states(0, 1)
    m.u = pyo.Var(m.t, bounds=(0, 4), initialize=1)
    m.least = pyo.Piecewise(
        m.t, m.u, m.x, pw_pts=[0, 1, 2, 10], f_rule=[1, 2, 1, 1], pw_constr_type='LB', pw_repn='INC', warn_domain_coverage=False
    )
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.u[t])
    m.goal = pyo.Objective(expr=m.x[1])
    run(m, 6, 3)
    end, met = exact(((0, 1), (1, 2), (2, 1), (10, 1)), 0, 1)
    assert m.x[1].value == pytest.approx(end, abs=1e-6)


@pytest.mark.parametrize('discretised', [False, True])
def test_integrands_may_be_in_pieces(discretised):
    m = states(0.0, 2)
    m.f = PiecewiseLinearFunction(points=[0, 0.5, 1, 10], function=lambda x: abs(x - 1))
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1)
    m.J = dae.Integral(m.t, rule=lambda m, t: m.f(m.x[t]) ** 2)
    m.goal = pyo.Objective(expr=m.J)
    if discretised:
        collocate(m, 5, 3)
        dcs(m)
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m)
        solve(m)
    else:
        run(m, 5, 3)
    assert pyo.value(m.goal) == pytest.approx(2 / 3, abs=1e-8)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([1], abs=1e-7)
    assert len(generated(m, Complementarity)) == len(m.t)


def test_an_integral_that_only_a_report_uses_is_evaluated_too():
    m = by_table(BENT, 0.5, 1.0)
    m.J = dae.Integral(m.t, rule=lambda m, t: m.f(m.x[t]))
    run(m, 6, 3)
    assert pyo.value(m.J) == pytest.approx(m.x[1].value - 0.5, abs=1e-9)


def test_held_controls_may_be_arguments():
    """The control is held on each of two stages: it may jump across a breakpoint only between them."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x = pyo.Var(m.t, initialize=0.0)
    m.dx = dae.DerivativeVar(m.x)
    m.u = pyo.Var(m.t, bounds=(0, 3), initialize=0.5)
    m.x[0].fix(0)
    m.f = PiecewiseLinearFunction(tabular_data={0: 0, 1: 2, 3: 3})
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f(m.u[t]))
    m.goal = pyo.Objective(expr=(m.x[1] - 1) ** 2 + (m.x[2] - 3.5) ** 2)
    run(m, 4, 2, piecewise_constant=[m.u])
    assert [m.u[t].value for t in (1, 2)] == pytest.approx([0.5, 2.0], abs=1e-5)


# What is read, what is left


def test_a_piecewise_without_time_stays_as_it_is():
    m = by_table(BENT, 0.5, 1)
    m.size, m.cost = pyo.Var(bounds=(0, 10)), pyo.Var()
    m.price = pyo.Piecewise(m.cost, m.size, pw_pts=[0, 1, 10], f_rule=[0, 2, 9], pw_constr_type='EQ')
    m.g = PiecewiseLinearFunction(tabular_data={0: 0, 1: 2, 10: 3})
    m.limit = pyo.Constraint(expr=m.g(m.size) <= 2)
    before = [str(m.limit.expr), m.price.active, m.g.active]
    dcs(m)
    assert [str(m.limit.expr), m.price.active, m.g.active] == before


def test_what_no_constraint_uses_is_not_transformed_and_not_in_the_way():
    m = by_table(BENT, 0.5, 1)
    m.g = PiecewiseLinearFunction(tabular_data={0: 0, 5: 2, 10: 3})
    m.extra = pyo.Expression(m.t, rule=lambda m, t: m.g(m.x[t]))
    run(m, 4, 2)
    assert m._pyomo_fesd_surfaces.x.positive_part.levels.data() == (1.0, 2.0)
    assert pyomo_fesd.trajectory(m)['extra'].isna().all()


def test_piecewise_over_time_and_a_further_index():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.i = pyo.Set(initialize=['a', 'b'])
    m.x = pyo.Var(m.i, m.t, bounds=(0, 10), initialize=0.5)
    m.y = pyo.Var(m.i, m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    m.f = pyo.Piecewise(
        m.i,
        m.t,
        m.y,
        m.x,
        pw_pts=[0, 1, 2, 10],
        f_rule=lambda m, i, t, x: {0: 1, 1: 3, 2: 2, 10: 2}[x] * (1 + (i == 'b')),
        pw_constr_type='EQ',
    )
    m.ode = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dx[i, t] == m.y[i, t])
    for i in m.i:
        m.x[i, 0].fix(0.5)
    run(m, 8, 3)
    assert m.x['a', 1].value == pytest.approx(exact(BENT, 0.5, 1)[0], abs=1e-5)
    assert m.x['b', 1].value == pytest.approx(exact(BENT, 0.5, 2)[0], abs=1e-5)
    assert {s.disjunction for s in pyomo_fesd.switches(m)} == {f'x[{i}] = {b}' for i in 'ab' for b in (1, 2)}


def test_an_indexed_function():
    m = states(0.5, 1)
    tables = {'a': dict(BENT), 'b': {0: 0, 10: 0}}
    m.f = PiecewiseLinearFunction(['a', 'b'], tabular_data_rule=lambda m, i: tables[i])
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f['a'](m.x[t]) + m.f['b'](m.x[t]))
    run(m, 8, 3)
    assert m.x[1].value == pytest.approx(exact(BENT, 0.5, 1)[0], abs=1e-5)


def test_functions_of_functions():
    m = states(0.5, 1)
    m.f = PiecewiseLinearFunction(tabular_data={0: 0, 1: 2, 10: 2})
    m.g = PiecewiseLinearFunction(tabular_data={0: 1, 1: 1, 2: 2})
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.g(m.f(m.x[t])))
    run(m, 6, 3)
    # g(f(x)) = 2 x up to x = 1, then 2
    assert m.x[1].value == pytest.approx(1 + 2 * (1 - log(2) / 2), abs=1e-6)


def test_a_second_application_changes_nothing():
    for build in WRITINGS:
        m = dcs(build(BENT, 0.5, 1))
        before = snapshot(m)
        assert snapshot(dcs(m)) == before


def test_what_pyomo_builds_anew_keeps_its_image():
    m = dcs(by_piecewise(BENT, 0.5, 1))
    first = m._pyomo_fesd_replaced.f[0]
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=2, ncp=2)
    assert m._pyomo_fesd_replaced.f[0] is first
    assert fesd_dcs.get_src_constraint(first) == [m.f[0]]
    assert fesd_dcs.get_transformed_constraints(m.f[0]) == [first]
    assert not any(b.active for b in m.f.values())


def test_a_clone_between_the_transformations_goes_its_own_way():
    m = dcs(by_function(BENT, 0.5, 1.5))
    copy = pyo.TransformationFactory('fesd.finite_elements').create_using(m, nfe=6, ncp=3)
    solve(copy)
    assert copy.x[1.5].value == pytest.approx(exact(BENT, 0.5, 1.5)[0], abs=1e-5)
    assert len(m.t) == 2 and all(v.model() is m for v in generated(m, pyo.Var))


def test_a_discretisation_that_fails_can_be_repeated():
    m = by_function(BENT, 0.5, 1.5)
    m.ode.deactivate()
    inner = pyo.Constraint.Skip
    m.inside = pyo.Constraint(m.t, rule=lambda m, t: inner if t in (0, 1.5) else m.dx[t] == m.f(m.x[t]))
    m.bad = Complementarity(m.t, rule=lambda m, t: complements(m.x[t] == 10, m.dx[t] >= 0))
    dcs(m)
    with pytest.raises(FesdError, match='one side is an equality'):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2, scheme='LAGRANGE-LEGENDRE')
    m.bad.deactivate()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=2, scheme='LAGRANGE-LEGENDRE')
    assert solve(m).x[1.5].value == pytest.approx(exact(BENT, 0.5, 1.5)[0], abs=1e-5)
    assert list(m._pyomo_fesd_surfaces.component_map()) == ['x']
    assert len(generated(m, Complementarity)) == 2 * (len(m.t) - 2)


@writings
def test_create_using_leaves_the_model_alone(build):
    m = build(JUMPING, 0.5, 1)
    before = snapshot(m)
    fesd_dcs.create_using(m)
    assert snapshot(m) == before


def test_inside_disjuncts():
    m = states(0.2, 2)
    m.f = PiecewiseLinearFunction(tabular_data={0: 1, 1: 2, 2: 1.5, 10: 1.5})
    m.g = PiecewiseLinearFunction(tabular_data={0: 0, 1: 2, 10: 2.9})

    @m.Disjunction(m.t)
    def mode(m, t):
        return [[m.g(m.x[t]) <= 2.05, m.dx[t] == m.f(m.x[t])], [m.g(m.x[t]) >= 2.05, m.dx[t] == 0.5]]

    run(m, 8, 3)
    # dx = 1 + x up to 1, then 2.5 - x/2 up to 1.5, where g is 2.05
    first = log(2 / 1.2)
    second = first + 2 * log(2 / 1.75)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([first, second, second + 1], abs=1e-6)
    assert [s.disjunction for s in pyomo_fesd.switches(m)] == ['x = 1', 'mode', 'x = 2']
    assert m.x[2].value == pytest.approx(1.5 + 0.5 * (2 - second), abs=1e-6)


def test_a_disjunction_as_target_takes_its_functions_along():
    m = by_piecewise(BENT, 0.5, 1)
    m.z, m.g = pyo.Var(m.t), PiecewiseLinearFunction(tabular_data={0: 1, 1: 2, 10: 3})
    m.mode = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.z[t] == m.g(m.x[t])], [m.x[t] >= 1, m.z[t] == 0]])
    dcs(m, targets=m.mode)
    assert len(generated(m, Complementarity)) == len(m.t)
    assert all(b.active for b in m.f.values())


def test_data_that_depend_on_the_time_label_are_named(caplog):
    m = states(0.5, 1)
    m.y = pyo.Var(m.t)
    m.f = pyo.Piecewise(m.t, m.y, m.x, pw_pts=[0, 1, 10], f_rule=lambda m, t, x: x * (1 + t), pw_constr_type='EQ')
    m.g = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == pyo.Expr_if(m.x[t] <= 1 + t, 1, 2) + m.y[t])
    transform(m, 2, 2)
    named = [r.getMessage().split(':')[0] for r in caplog.records if 'time label' in r.getMessage()]
    assert named == ['x', '_pyomo_fesd_replaced.f']


def test_levels_that_differ_from_stage_to_stage_are_data_as_others(caplog):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2])
    m.x = pyo.Var(m.t, initialize=0.0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == pyo.Expr_if(m.x[t] <= (0.5 if t <= 1 else 2), 1, 2))
    run(m, 8, 2)
    # 0.5 in 0.5 h, then 1.5 at the end of the stage; 2 half an hour later, 3 at the end
    assert m.x[2].value == pytest.approx(3, abs=1e-9)
    assert not [r for r in caplog.records if 'time label' in r.getMessage()]


# What is refused


def with_function(**keywords):
    def build():
        m = states(0.5, 1)
        m.f = PiecewiseLinearFunction(**keywords)
        m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f(m.x[t]))
        return m

    return build


def line(x):
    return 1 + x


def three_values():
    return by_piecewise(((0, 1), (1, 1), (1, 5), (1, 2), (10, 2)), 0.5, 1)


def jump_by_itself():
    m = states(0.5, 1)
    m.f = PiecewiseLinearFunction(simplices=[(0, 1), (1, 2)], linear_functions=[lambda x: 0 * x, lambda x: 0 * x + 1])
    m.y = pyo.Var(m.t)
    m.own = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == m.f(m.y[t] + m.x[t]))
    return m


def jump_of_a_rate():
    m = jump_by_itself()
    m.own.deactivate()
    m.rate = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == m.f(m.dx[t]))
    return m


def bad_disjunction():
    m = by_piecewise(STAIRS, 0.5, 1)
    m.e = pyo.Expression(m.t, rule=lambda m, t: pyo.Expr_if(m.x[t] > 3, 1, m.x[t]))
    m.uses = pyo.Constraint(m.t, rule=lambda m, t: m.e[t] <= 10 + pyo.Expr_if(m.x[t] > 4, 1, 2))
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.dx[t] == m.e[t]], [m.x[t] >= 2, m.dx[t] == 1]])
    return m


def segments(*simplices, last=line):
    return with_function(simplices=list(simplices), linear_functions=[line] * (len(simplices) - 1) + [last])


REFUSED = {
    'three values at one point': (three_values, 'f[0]', 'more than two values at the breakpoint 1.0'),
    'a gap between segments': (segments((0, 1), (2, 3)), 'f', 'leave a gap between 1 and 2'),
    'segments that overlap': (segments((0, 2), (1, 3)), 'f', 'overlap between 1 and 2'),
    'a curved piece': (segments((0, 1), (1, 3), last=lambda x: x**2), 'f', 'between 1 and 3 is not linear'),
    'a jump at its own value': (jump_by_itself, 'own[0]', "contains 'y[0]', which it defines itself"),
    'a jump at a rate': (jump_of_a_rate, 'rate[0]', "contains the derivative 'dx[0]'"),
    'a Disjunction that is refused': (bad_disjunction, 'sgn[0]', 'leave a gap'),
}


@pytest.mark.parametrize('build, name, cause', REFUSED.values(), ids=REFUSED.keys())
def test_what_is_refused_is_named_and_the_model_is_as_it_was(build, name, cause):
    m = build()
    before = snapshot(m)
    with pytest.raises(FesdError) as error:
        dcs(m)
    assert error.value.component == name and cause in error.value.cause
    assert snapshot(m) == before


def test_a_refused_second_application_takes_back_only_what_it_added():
    m = dcs(by_piecewise(STAIRS, 0.5, 1))
    m.more = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] <= pyo.Expr_if(m.x[t] > 2, 4, pyo.Expr_if(m.x[t] > 3, 2, 1)))
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1, m.dx[t] == 1], [m.x[t] >= 2, m.dx[t] == 1]])
    before = snapshot(m)
    with pytest.raises(FesdError):
        dcs(m)
    assert snapshot(m) == before


@pytest.mark.parametrize('blocks', [False, True])
def test_after_pyomos_own_transformation_the_error_says_what_to_leave_out(blocks):
    m = states(0.5, 1)
    collocate(m)
    if blocks:
        m.pipe = pyo.Block(m.t)
        for t in m.t:
            m.pipe[t].f = PiecewiseLinearFunction(tabular_data=dict(BENT))
        m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.pipe[t].f(m.x[t]))
    else:
        m.f = PiecewiseLinearFunction(tabular_data=dict(BENT))
        m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f(m.x[t]))
    targets = [b.f for b in m.pipe.values()] if blocks else [m.f]
    pyo.TransformationFactory('contrib.piecewise.outer_repn_gdp').apply_to(m, targets=targets)
    with pytest.raises(FesdError, match='fesd.dcs takes the PiecewiseLinearFunction itself'):
        dcs(m)
