"""Copies: what is written for a Disjunction that is built like another one must be what would have been written for it alone."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.core.expr.compare import compare_expressions
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd.core import all_switched_systems
from pyomo_fesd.core.expression_key import prefix_tokens
from pyomo_fesd.dcs.blended_copies import BlendedCopies
from tests.models import dcs, generated, quadrants, signum, signum_of_lists, signum_of_scalars, tank, units, units_by_index

MODELS = [quadrants, signum, signum_of_lists, signum_of_scalars, tank, units, units_by_index]
TRANSFORMATION = pyo.TransformationFactory('fesd.dcs')


def structure(expr):
    """The nodes of an expression with their classes, its numbers, and its components by name."""
    return prefix_tokens([expr], lambda node: (node.name, ()))


def written(m):
    """All that ``fesd.dcs`` has written, with its sources and records."""
    rows = {name: structure(c.expr) for name, c in generated(m, pyo.Constraint).items()}
    pairs = {name: tuple(map(structure, c._args)) for name, c in generated(m, Complementarity).items()}
    variables = {name: (v.value, v.lb, v.ub, v.fixed) for name, v in generated(m, pyo.Var).items()}
    data = [*generated(m, pyo.Constraint).values(), *generated(m, Complementarity).values()]
    sources = {c.name: TRANSFORMATION.get_src_disjunction(c).name for c in data}
    behind = {c.name: [s.name for s in TRANSFORMATION.get_src_constraint(c)] for c in data if '.mode[' in c.name}
    systems = all_switched_systems(m)
    multipliers = {d.name: structure(nu) for d, nu in systems.multipliers.items()}
    steps = [(step.nu.name, structure(step.c)) for step in systems.steps]
    dependents = [([v.name for v in d.variables], list(map(structure, d.arguments)), d.values) for d in systems.dependents]
    return rows, pairs, variables, sources, behind, multipliers, steps, dependents, [v.name for v in systems.selectors]


@pytest.fixture
def copies(monkeypatch):
    """The Disjunctions that were copied, by name."""
    found, write = [], BlendedCopies.write

    def counted(self, block, index, system, parts):
        found.append(system.disjunction.name)
        return write(self, block, index, system, parts)

    monkeypatch.setattr(BlendedCopies, 'write', counted)
    return found


@pytest.fixture
def alone(monkeypatch):
    """A function that transforms a model, each Disjunction by itself."""

    def transform(m, **keywords):
        with monkeypatch.context() as patch:
            patch.setattr('pyomo_fesd.dcs.reading.system.expression_key', lambda expressions, kind: (None, []))
            return dcs(m, **keywords)

    return transform


@pytest.mark.parametrize('form', ['auto', 'heaviside', 'stewart'])
@pytest.mark.parametrize('build', MODELS)
def test_a_copy_is_what_would_have_been_written_alone(build, form, copies, alone):
    m = dcs(build(discretised=True), form=form)
    assert len(copies) >= len(m.t) - 1
    number = len(copies)
    assert written(m) == written(alone(build(discretised=True), form=form)) and len(copies) == number


def linear(change=None, at=None):
    """x' = a x + b p + 3 below zero and 1 above it, on a grid; ``change(m, t)`` gives other modes at one time."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2, 3, 4, 5])
    m.x, m.y, m.u = pyo.Var(m.t, initialize=-2.0), pyo.Var(m.t, initialize=0.5), pyo.Var(m.t, bounds=(0, 1), initialize=0.1)
    m.p = pyo.Param(m.t, mutable=True, initialize=2.0)
    m.dx = dae.DerivativeVar(m.x)
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.t, nfe=5, scheme='BACKWARD')

    def rule(m, t):
        if change is not None and t == at:
            return change(m, t)
        return usual(m, t)

    m.sgn = Disjunction(m.t, rule=rule)
    return m


def usual(m, t):
    return [[m.x[t] <= 0, m.dx[t] == 2 * m.x[t] + m.p[t] * m.y[t] + 3], [m.x[t] >= 0, m.dx[t] == 1]]


def coefficient(m, t):
    return [[m.x[t] <= 0, m.dx[t] == 2.5 * m.x[t] + m.p[t] * m.y[t] + 3], [m.x[t] >= 0, m.dx[t] == 1]]


def constant(m, t):
    return [[m.x[t] <= 0, m.dx[t] == 2 * m.x[t] + m.p[t] * m.y[t] + 4], [m.x[t] >= 0, m.dx[t] == 1]]


def side(m, t):
    return [[m.x[t] >= 0, m.dx[t] == 2 * m.x[t] + m.p[t] * m.y[t] + 3], [m.x[t] <= 0, m.dx[t] == 1]]


def further_term(m, t):
    return [[m.x[t] <= 0, m.dx[t] == 2 * m.x[t] + m.p[t] * m.y[t] + 3 + m.u[t]], [m.x[t] >= 0, m.dx[t] == 1]]


def other_variable(m, t):
    return [[m.x[t] <= 0, m.dx[t] == 2 * m.x[t] + m.p[t] * m.x[t] + 3], [m.x[t] >= 0, m.dx[t] == 1]]


def other_bounds(m, t):
    return [[m.x[t] <= 0, m.dx[t] == 2 * m.x[t] + m.p[t] * m.u[t] + 3], [m.x[t] >= 0, m.dx[t] == 1]]


def other_time(m, t):
    return [[m.x[t] <= 0, m.dx[t] == 2 * m.x[t] + m.p[t] * m.y[t - 1] + 3], [m.x[t] >= 0, m.dx[t] == 1]]


def other_param(m, t):
    m.p[t] = 7.0
    return usual(m, t)


def further_region(m, t):
    return [[m.x[t] <= 0, m.y[t] <= 9, m.dx[t] == 1], [m.x[t] <= 0, m.y[t] >= 9, m.dx[t] == 2], [m.x[t] >= 0, m.dx[t] == 1]]


CHANGES = [coefficient, constant, side, further_term, other_variable, other_bounds, other_param, further_region]


@pytest.mark.parametrize('change', CHANGES)
def test_one_that_differs_is_no_copy_of_the_others(change, copies, alone):
    m = dcs(linear(change, at=3))
    assert copies == ['sgn[1]', 'sgn[2]', 'sgn[4]', 'sgn[5]']
    assert written(m) == written(alone(linear(change, at=3)))


@pytest.mark.parametrize('change', [coefficient, constant, other_param])
def test_the_values_that_differ_are_in_the_equation(change):
    m = dcs(linear(change, at=3))
    rates = [c.expr for c in generated(m, pyo.Constraint).values() if '.mode[' in c.name]
    x, dx, alpha = m.x, m.dx, m._pyomo_fesd_dcs.sgn.alpha
    for t, row in enumerate(rates):
        x[t].value, dx[t].value, alpha[t].value = 1.0, 0.0, 1.0
        found = sorted(map(abs, (pyo.value(row.args[0] - row.args[1]),)))
        expected = 2 + 2.0 * 0.5 + 3
        assert (found == [pytest.approx(expected)]) is (t != 3)


def test_variables_of_another_time_are_put_where_they_were(copies, alone):
    assert written(dcs(linear(other_time, at=3))) == written(alone(linear(other_time, at=3)))
    assert 'sgn[3]' in copies


def test_an_inequality_in_place_of_an_equation_is_refused_as_alone():
    def inequality(m, t):
        return [[m.x[t] <= 0, m.dx[t] <= 2 * m.x[t] + m.p[t] * m.y[t] + 3], [m.x[t] >= 0, m.dx[t] == 1]]

    with pytest.raises(Exception, match='derivative|equation'):
        dcs(linear(inequality, at=3))


def test_switching_functions_in_other_units_are_divided_by_their_own(alone):
    def build():
        m = pyo.ConcreteModel()
        m.t = dae.ContinuousSet(initialize=[0, 1, 2, 3])
        m.a, m.b = pyo.Var(m.t, units=pyo.units.m, initialize=1), pyo.Var(m.t, units=pyo.units.kg, initialize=1)
        m.f, m.g = pyo.Var(m.t, initialize=1), pyo.Var(m.t, initialize=1)
        pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.t, nfe=3, scheme='BACKWARD')
        for name, x, f in (('long', m.a, m.f), ('heavy', m.b, m.g)):
            m.add_component(name, Disjunction(m.t, rule=lambda m, t, x=x, f=f: [[x[t] <= 0, f[t] == 3], [x[t] >= 0, f[t] == 1]]))
        return m

    m = dcs(build())
    assert written(m) == written(alone(build()))
    assert 'kg' in str(m._pyomo_fesd_dcs.heavy.switching[2].expr) and 'kg' not in str(m._pyomo_fesd_dcs.long.switching[2].expr)


def test_modes_that_are_implicit_or_continued_are_written_one_by_one(copies):
    def root(m, t):
        return [[m.x[t] >= 0, m.y[t] == pyo.sqrt(m.x[t])], [m.x[t] <= 0, m.y[t] == 0]]

    def implicit(m, t):
        return [[m.x[t] >= 0, m.y[t] + pyo.exp(m.y[t]) == m.x[t]], [m.x[t] <= 0, m.y[t] == 0]]

    for rule in (root, implicit):
        m = linear()
        m.del_component('sgn')
        m.sgn = Disjunction(m.t, rule=rule)
        dcs(m)
    assert copies == []


def test_clones_have_copies_of_their_own():
    m = dcs(quadrants(discretised=True), form='stewart')
    other = m.clone()
    assert written(other) == written(m)
    systems = all_switched_systems(other)
    assert systems.selectors and all(v.model() is other for v in systems.selectors)
    assert all(v.model() is other for one in systems.dependents for v in one.variables)


def test_a_copy_contains_no_node_of_the_first_but_constants():
    m = dcs(tank(discretised=True))
    rows = [c.expr for c in generated(m, pyo.Constraint).values() if '.mode[' in c.name]
    assert len({id(row.args[1]) for row in rows}) == len(rows)
    assert not compare_expressions(rows[0], rows[-1])


def at_new_times(m):
    """All rows that are written at times that the tank has after its discretisation only."""
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=3, ncp=2)
    block, given = m._pyomo_fesd_dcs.outlet, ('[0', '[4')
    rows = {c.name: structure(c.expr) for c in block.component_data_objects(pyo.Constraint)}
    variables = {v.name: (v.value, v.lb, v.ub, v.fixed) for v in block.component_data_objects(pyo.Var)}
    return {name: found for name, found in (rows | variables).items() if not any(end in name for end in given)}


def test_what_a_user_changes_before_there_are_further_times_is_not_copied():
    m = dcs(tank())
    block = m._pyomo_fesd_dcs.outlet
    for t in (0, 4):
        block.mode[t, 1].set_value(m.L[t] == 7)
        block.p[t].setub(9)
    block.alpha[0].fix(1)
    assert at_new_times(m) == at_new_times(dcs(tank())) != {}


def test_a_clone_is_continued_with_its_own_components():
    m = dcs(tank())
    other = m.clone()
    assert at_new_times(other) == at_new_times(m)
    rows = other._pyomo_fesd_dcs.component_data_objects(pyo.Constraint, descend_into=True)
    assert all(v.model() is other for row in rows for v in identify_variables(row.body, include_fixed=True))
