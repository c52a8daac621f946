"""Rows by classes have the values and derivatives that casadi finds in Pyomo's NL file, as SX and MX, with classes and without."""

import casadi as ca
import numpy as np
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import mpcc_collection, small_mpccs
from problems.parts import compiled
from pyomo.mpec import Complementarity, complements
from pyomo.repn.plugins.nl_writer import NLWriter

from pyomo_fesd.mpcc.compile import assemble, grouped_rows, row_classes, scaled_functions
from pyomo_fesd.mpcc.compile.derivatives import automatic, plain_nlp
from pyomo_fesd.mpcc.subproblems.relaxation import RELAXATIONS, Relaxation
from pyomo_fesd.mpcc.subproblems.side_constraints import sort_sides

#: (kind, parts of equal form that make a class)
WAYS = [(ca.SX, 1), (ca.SX, 1000), (ca.MX, 1), (ca.MX, 1000)]


@pytest.fixture(scope='module', autouse=True, params=[0, 10**9], ids=['called', 'operations'])
def by_classes(request):
    """No model counts as short: derivatives are those of the classes, called for each instance or operation by operation."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scaled_functions, 'SHORT', -1)
        patch.setattr(row_classes, 'LONG', request.param)
        yield


def in_one_way(model, kind, alike, parameters=()):
    """The model compiled with these symbols and classes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assemble, 'LARGE', -1 if kind is ca.MX else 10**9)
        patch.setattr(grouped_rows, 'ALIKE', alike)
        c = compiled(model, parameters)
    assert c.kind is kind
    return c


def of_nl_file(model, path):
    """(names of the variables, of the rows, function x -> f, g) of the model without pairs as casadi reads its NL file."""
    pairs = [c for c in model.component_objects(Complementarity, active=True)]
    for c in pairs:
        c.deactivate()
    with open(path, 'w', newline='') as stream:
        info = NLWriter().write(model, stream, linear_presolve=False, scale_model=False, symbolic_solver_labels=False)
    for c in pairs:
        c.activate()
    nl = ca.NlpBuilder()
    nl.import_nl(str(path))
    lower = np.where(np.isfinite(nl.g_lb), nl.g_lb, nl.g_ub)
    function = ca.Function('nl', [ca.vertcat(*nl.x)], [nl.f, ca.vertcat(*nl.g) - lower]).expand()
    return [v.name for v in info.variables], [c.name for c in info.constraints], function


def alike(seed):
    """Rows and sides of few forms with random data, nested expressions, repeated variables."""
    random = np.random.default_rng(seed)
    m = pyo.ConcreteModel()
    m.i = pyo.RangeSet(0, 4)
    m.x = pyo.Var(pyo.RangeSet(0, 9), initialize=lambda m, i: random.uniform(0.2, 2), bounds=(0.05, 9))
    pick = lambda: m.x[int(random.integers(10))]  # noqa: E731
    number = lambda: random.choice([1.0, 2.0, -1.0, *random.normal(size=3)])  # noqa: E731
    m.inner = pyo.Expression(m.i, rule=lambda m, i: number() * pick() * pick() + number() * pick() + number())
    m.outer = pyo.Expression(m.i, rule=lambda m, i: pyo.exp(number() * m.inner[i]) + m.inner[i] + pick())
    m.rows = pyo.Constraint(m.i, rule=lambda m, i: number() * pick() * pick() ** 1.3 + pick() / (1 + pick()) <= number() + 3)
    m.nested = pyo.Constraint(m.i, rule=lambda m, i: m.outer[i] * pick() - number() * m.inner[int(random.integers(5))] >= number())
    m.linear = pyo.Constraint(m.i, rule=lambda m, i: number() * pick() + number() * pick() + number() == number())
    Q = random.normal(size=(5, 10))
    form = sum(m.x[i] * pyo.quicksum(Q[i, j] * m.x[j] for j in range(10)) * random.choice([1, 0.7]) for i in m.i)
    m.f = pyo.Objective(
        expr=sum(number() * (pick() - number()) ** 2 * pick() for _ in m.i) - 3 * m.outer[0] + form,
        sense=random.choice([pyo.minimize, pyo.maximize]),
    )
    m.pair = Complementarity(m.i, rule=lambda m, i: complements(pick() ** 2 + number() >= 0, pick() * pick() - number() >= 0))
    return m


def agree_with_nl_file(m, path, kind, count):
    variables, rows, function = of_nl_file(m, path)
    c = in_one_way(m, kind, count)
    place = [[v.name for v in c.variables].index(name) for name in variables]
    order = [[con.name for con in c.constraints].index(name) for name in rows]
    nlp = plain_nlp(c) if not c.pairs else None
    random = np.random.default_rng(0)
    lower = np.where(np.isfinite(c.lbg), c.lbg, c.ubg)
    x = ca.SX.sym('x', len(variables))
    derived = ca.Function('d', [x], [ca.jacobian(out, x) for out in function(x)])
    for _ in range(3):
        w = random.uniform(0.1, 2, len(c.x0))
        f, g = (np.asarray(v, dtype=float).ravel() for v in function(w[place]))
        at, (gradient, J, *_) = c.evaluate(w), c.gradients(w)
        np.testing.assert_allclose(at.f, f[0], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose((at.g - lower)[order], g, rtol=1e-10, atol=1e-10)
        wanted = [np.array(d) for d in derived(w[place])]
        np.testing.assert_allclose(gradient[place], wanted[0].ravel(), rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(J.toarray()[np.ix_(order, place)], wanted[1], rtol=1e-10, atol=1e-10)
    assert nlp is None or nlp.g.numel() == len(rows)


@pytest.mark.parametrize('kind, count', WAYS)
@pytest.mark.parametrize('make', [mpcc_collection.hakonsen, mpcc_collection.bilin, mpcc_collection.plain_nlp])
def test_values_and_slopes_are_those_of_the_nl_file(make, kind, count, tmp_path):
    m = make()
    agree_with_nl_file(m[0] if isinstance(m, tuple) else m, tmp_path / 'm.nl', kind, count)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), way=st.sampled_from(WAYS))
def test_random_rows_of_few_forms(seed, way, tmp_path_factory):
    agree_with_nl_file(alike(seed), tmp_path_factory.mktemp('nl') / 'm.nl', *way)


@pytest.mark.parametrize('kind, count', WAYS)
@pytest.mark.parametrize('form', ['elastic', 'scholtes', 'l1'])
def test_all_ways_have_the_same_derivatives(form, kind, count):
    """Of a relaxation, against casadi's own of the plain graph, also by parameters and with factors."""

    def handed(way):
        m = alike(3)
        m.a = pyo.Param(initialize=1.7, mutable=True)
        m.with_parameter = pyo.Constraint(m.i, rule=lambda m, i: m.a * m.x[i] ** 2 + m.x[i + 1] * m.a**2 <= m.a)
        m.scaling_factor = pyo.Suffix()
        m.scaling_factor[m.x[2]], m.scaling_factor[m.nested[1]] = 10.0, 0.25
        c, made = in_one_way(m, *way, [m.a]), []
        Relaxation(c, sort_sides(c), RELAXATIONS[form][1], lambda name, *nlp: made.append(nlp))
        x, p, f, g, _, d = made[0]
        return c, x, p, f, g, d

    c, x, p, f, g, d = handed((kind, count))
    own = ca.Function('own', [x, p, d.lam_f, d.lam_g], [f, g, d.gradient, d.jacobian, d.hessian])
    _, x, p, f, g, _ = handed((ca.SX, 1000))
    d = automatic(x, f, g)
    casadi = ca.Function('casadi', [x, p, d.lam_f, d.lam_g], [f, g, d.gradient, d.jacobian, d.hessian])
    random = np.random.default_rng(5)
    for eps in (1.0, 1e-3):
        at = random.uniform(0.1, 2, x.numel()), [eps, 1.7], 0.7, random.normal(size=g.numel())
        for found, wanted in zip(own(*at), casadi(*at)):
            np.testing.assert_allclose(np.array(found), np.array(wanted), rtol=1e-9, atol=1e-9)


def test_rows_of_one_form_are_one_class():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(pyo.RangeSet(0, 40), initialize=1.0)
    m.data = pyo.Param(pyo.RangeSet(0, 39), initialize=lambda m, i: 0.3 + i / 7)
    m.row = pyo.Constraint(pyo.RangeSet(0, 39), rule=lambda m, i: m.data[i] * pyo.exp(m.x[i]) * m.x[i + 1] - m.x[i] == 0.1 * i)
    (found,) = compiled(m)._functions.rows.functions.classes
    assert found.columns.shape == (2, 40)


@pytest.mark.parametrize('variable_first', [True, False])
def test_a_quadratic_form_has_a_class_for_squares_and_one_for_products(variable_first):
    n, Q = 30, np.random.default_rng(0).normal(size=(30, 30)) / 10
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(n), initialize=1.0)
    sums = [pyo.quicksum(Q[i, j] * m.x[j] for j in range(n)) for i in range(n)]
    m.f = pyo.Objective(expr=sum(m.x[i] * sums[i] if variable_first else sums[i] * m.x[i] for i in range(n)))
    m.row = pyo.Constraint(expr=m.x[0] ** 2 >= 0)
    c = compiled(m)
    assert sorted(k.columns.shape for k in c._functions.cost.functions.classes) == [(1, n), (2, n * (n - 1))]
    x = np.random.default_rng(1).normal(size=n)
    at = dict(zip((v.index() for v in c.variables), x))
    x_of_model = np.array([at[i] for i in range(n)])
    assert c.evaluate(x).f == pytest.approx(x_of_model @ Q @ x_of_model, rel=1e-12)


def test_a_long_chain_of_expressions_is_evaluated_once():
    """e_k = e_{k-1} + sin(e_{k-1}): writing each one out would take 2^k terms."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=0.3)
    m.y = pyo.Var(initialize=0.3)
    m.e = pyo.Expression(pyo.RangeSet(0, 300))
    m.e[0] = m.x * m.y
    for k in range(1, 301):
        m.e[k] = m.e[k - 1] + 0.01 * pyo.sin(m.e[k - 1]) ** 2
    m.row = pyo.Constraint(pyo.RangeSet(0, 300), rule=lambda m, k: m.e[k] <= 5)
    c = compiled(m)
    found = dict(zip((con.name for con in c.constraints), c.evaluate(np.array([0.3, 0.3])).g))
    wanted = 0.09
    for k in range(301):
        assert found[f'row[{k}]'] == pytest.approx(wanted, rel=1e-12)
        wanted += 0.01 * np.sin(wanted) ** 2


def test_the_parts_of_a_solve_agree_in_symbols_of_both_kinds():
    """A solve with MX ends where one with SX does."""
    ends = []
    for large in (-1, 10**9):
        m = small_mpccs.bard1()[0]
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(assemble, 'LARGE', large)
            pyo.SolverFactory('mpec_hybrid').solve(m)
        ends.append([v.value for v in m.component_data_objects(pyo.Var)])
    np.testing.assert_allclose(*ends, atol=1e-7)


def test_a_side_that_is_a_parameter_keeps_its_unit():
    m = small_mpccs.pair(1.0, 0.0)
    m.f = pyo.Objective(expr=(m.y - 1) ** 2)
    m.given = pyo.Var(initialize=0.0, bounds=(0, None))
    m.given.fix()
    m.c2 = Complementarity(expr=complements(m.given >= 0, m.y >= 0))
    c = compiled(m, [m.given])
    assert c.pairs == 2
    np.testing.assert_array_equal(c.scale.sides, np.ones(4))
