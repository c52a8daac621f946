"""The derivatives that all NLPs share, against those that casadi finds for each NLP alone."""

from functools import cache

import casadi as ca
import numpy as np
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import mpcc_collection, small_mpccs
from problems.parts import compiled
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import BranchConstraint, Penalty, homotopy_hints
from pyomo_fesd.mpcc.compile import assemble, scaled_functions
from pyomo_fesd.mpcc.compile.derivatives import Outer, automatic, composed
from pyomo_fesd.mpcc.subproblems.branch import Branch
from pyomo_fesd.mpcc.subproblems.relaxation import RELAXATIONS, Relaxation
from pyomo_fesd.mpcc.subproblems.side_constraints import sort_sides


def with_decisions():
    """Two pairs, one of them decided, a penalty, a nonlinear row."""
    m = small_mpccs.pair(0.5, 0.5)
    m.z = pyo.Var([1, 2], initialize=0.4)
    m.row = pyo.Constraint(expr=m.x * pyo.exp(m.z[1]) + m.y**2 <= 3)
    m.f = pyo.Objective(expr=m.x * m.y * m.z[1] + pyo.sin(m.z[2]))
    m.decided = Complementarity(expr=complements(m.z[1] ** 2 + 1 >= 0, m.z[2] ** 2 + m.x >= 0))
    m.impose = pyo.Constraint(expr=m.z[1] * m.z[2] == m.x**2)
    m.impose.deactivate()
    m.guide = pyo.Expression(expr=(m.x - 1) ** 2 * m.z[2])
    hints = homotopy_hints(m)
    hints.branch_constraints.append(BranchConstraint(m.decided, m.impose))
    hints.penalties.append(Penalty(m.guide, 0.7))
    return compiled(m)


def a_decision_alone():
    """One decided pair and no other."""
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(bounds=(0, 4), initialize=1), pyo.Var(bounds=(0, 4), initialize=2)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 2) ** 2)
    m.alike = Complementarity(expr=complements((m.x - m.y) ** 2 >= 0, m.x * m.y >= 0))
    m.equal = pyo.Constraint(expr=m.x == m.y)
    m.equal.deactivate()
    homotopy_hints(m).branch_constraints.append(BranchConstraint(m.alike, m.equal))
    return compiled(m)


def with_parameters():
    """Param and fixed variable in objective, row and sides."""
    m = small_mpccs.pair(0.5, 0.5)
    m.a = pyo.Param(initialize=1.3, mutable=True)
    m.b = pyo.Var(initialize=0.6)
    m.b.fix()
    m.row = pyo.Constraint(expr=m.a * m.x**2 + m.b * m.y <= 2)
    m.f = pyo.Objective(expr=(m.x - m.a) ** 2 * m.y)
    m.d = Complementarity(expr=complements(m.x + m.a >= 0, m.y * m.b - m.x**2 + 1 >= 0))
    return compiled(m, [m.a, m.b])


def nothing_at_all():
    """No rows, no pairs, no objective."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1, 2], initialize=1, bounds=(0, 3))
    m.row = pyo.Constraint(expr=m.x[1] + m.x[2] >= -1)
    c = compiled(m)
    assert not c.G.numel()
    return c


PROBLEMS = {
    'no rows': lambda: compiled(small_mpccs.toy()[0]),
    'no pairs': lambda: compiled(mpcc_collection.plain_nlp()),
    'no pairs and no objective': nothing_at_all,
    'linear': lambda: compiled(small_mpccs.bard1()[0]),
    'one bilinear row': lambda: compiled(mpcc_collection.bard3()),
    'mixed': lambda: compiled(small_mpccs.mixed()[0]),
    'exponential side': lambda: compiled(mpcc_collection.scholtes1()),
    'maximised': lambda: compiled(small_mpccs.maximising()[0]),
    'decisions': with_decisions,
    'a decision alone': a_decision_alone,
    'parameters': with_parameters,
}


@pytest.fixture(scope='module', autouse=True)
def by_the_chain_rule():
    """No problem counts as short: casadi's own derivatives are those to compare with."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scaled_functions, 'SHORT', -1)
        yield


def test_gradients_alone_make_no_hessian():
    c = PROBLEMS['exponential side']()
    c.gradients(c.x0)
    assert 'derivatives' in vars(c) and '_curvatures' not in vars(c.derivatives)


@pytest.fixture(params=PROBLEMS)
def c(request):
    return PROBLEMS[request.param]()


def made(build):
    """What an NLP solver is handed: x, p, f, g and the derivatives."""
    handed = []
    build(lambda name, x, p, f, g, budget, derivatives: handed.append((x, p, f, g, derivatives)))
    return handed[0]


def as_function(x, p, derivatives):
    d = derivatives
    parts = [ca.densify(e) for e in (d.gradient, d.jacobian, d.hessian)]
    return ca.Function('d', [x, p, d.lam_f, d.lam_g], parts)


def agree(x, p, f, g, derivatives, points):
    """At each ``(w, p)``, for random multipliers; the shapes are those that casadi gives."""
    own, casadi = as_function(x, p, derivatives), as_function(x, p, automatic(x, f, g))
    random = np.random.default_rng(0)
    for w, values in points:
        multipliers = random.normal(), random.normal(size=g.numel())
        for found, wanted in zip(own(w, values, *multipliers), casadi(w, values, *multipliers)):
            assert found.shape == wanted.shape
            np.testing.assert_allclose(np.array(found), np.array(wanted), rtol=1e-9, atol=1e-9)


def random_points(n, parameters, eps=(1.0, 1e-2, 1e-5), seed=1):
    random = np.random.default_rng(seed)
    return [(random.uniform(0.05, 2.0, n), np.concatenate([[e], parameters])) for e in eps]


@pytest.mark.parametrize('form', RELAXATIONS)
def test_every_relaxation(c, form):
    kind, terms = RELAXATIONS[form]
    x, p, *rest = made(lambda make: kind(c, sort_sides(c), terms, make))
    agree(x, p, *rest, random_points(x.numel(), c.parameters))


def test_the_branch_nlp(c):
    x, p, *rest = made(lambda make: Branch(c, sort_sides(c), make).solvers)
    agree(x, p, *rest, random_points(x.numel(), c.parameters))


@pytest.mark.parametrize('form', ['elastic', 'l1', 'scholtes', 'branch'])
def test_short_problems_get_the_same_nlp(c, form, monkeypatch):
    def build(make):
        if form == 'branch':
            return Branch(c, sort_sides(c), make).solvers
        return Relaxation(c, sort_sides(c), RELAXATIONS[form][1], make)

    def handed():
        x, p, f, g, d = made(build)
        outputs = [f, g, d.gradient, d.jacobian, d.hessian]
        return ca.Function('nlp', [x, p, d.lam_f, d.lam_g], [ca.densify(output) for output in outputs])

    assert not c.short
    long = handed()
    monkeypatch.setattr(scaled_functions, 'SHORT', 10**9)
    assert c.short
    short, random = handed(), np.random.default_rng(3)
    for w, values in random_points(long.numel_in(0), c.parameters):
        at = w, values, random.normal(), random.normal(size=long.numel_in(3))
        for found, wanted in zip(short(*at), long(*at)):
            assert found.shape == wanted.shape
            np.testing.assert_allclose(np.array(found), np.array(wanted), rtol=1e-9, atol=1e-9)


def calls(function):
    """Names of the functions that an MX function calls, one for each call."""
    ids = [k for k in range(function.n_instructions()) if function.instruction_id(k) == ca.OP_CALL]
    return [function.instruction_MX(k).which_function().name() for k in ids]


def test_a_gradient_evaluates_no_rows_and_a_hessian_no_values_of_linear_sides(monkeypatch):
    monkeypatch.setattr(assemble, 'LARGE', -1)
    c = PROBLEMS['linear']()
    x, p, _, _, d = made(lambda make: Relaxation(c, sort_sides(c), RELAXATIONS['elastic'][1], make))
    gradient = ca.Function('gradient', [x, p], [d.gradient])
    hessian = ca.Function('hessian', [x, p, d.lam_f, d.lam_g], [d.hessian])
    assert calls(gradient).count('slopes') == 1 and 'values' not in calls(gradient)
    assert calls(hessian).count('curvatures') == 1 and 'values' not in calls(hessian)


@pytest.mark.parametrize('form', ['kanzow_schwartz', 'steffensen_ulbrich'])
@pytest.mark.parametrize('x, y', [(2.0, 2.0), (0.01, 0.02), (3.0, 0.001), (0.001, 3.0), (0.2, 0.25)])
def test_every_piece_of_a_piecewise_form(form, x, y):
    c = with_parameters()
    w = [{'x': x, 'y': y}[v.name] for v in c.variables]
    nlp = made(lambda make: Relaxation(c, sort_sides(c), RELAXATIONS[form][1], make))
    agree(*nlp, [(w, np.concatenate([[eps], c.parameters])) for eps in (1.0, 1e-2)])


def test_the_slack_of_the_elastic_form_stands_last():
    c = compiled(small_mpccs.toy()[0])
    x, p, f, g, derivatives = made(lambda make: Relaxation(c, sort_sides(c), RELAXATIONS['elastic'][1], make))
    assert x.numel() == len(c.x0) + 1
    gradient, jacobian, _ = as_function(x, p, derivatives)([1.0, 1.0, 0.5], [0.25], 1.0, np.ones(g.numel()))
    assert float(gradient[-1]) == pytest.approx(4)
    assert float(jacobian[-1, -1]) == -1


def test_the_models_hessian_is_that_of_its_lagrangian(c):
    random = np.random.default_rng(2)
    w, factors = random.uniform(0.1, 1.5, len(c.x0)), (0.3, -0.8, random.normal(size=c.g.numel()))
    of_z = random.normal(size=c.inner)
    inner = ca.vertcat(c.G, c.H, c.equal)
    lagrangian = factors[0] * c.f + factors[1] * c.penalty
    for weights, rows in ((factors[2], c.g), (of_z, inner)):
        for weight, row in zip(weights, ca.vertsplit(rows) if rows.numel() else []):
            lagrangian += weight * row
    found = c.derivatives.hessian(c.x, c.p, ca.vertcat(*factors[:2]), factors[2], of_z)
    wanted = ca.triu(ca.hessian(lagrangian, c.x)[0])
    both = ca.Function('h', [c.x, c.p], [ca.densify(found), ca.densify(wanted)])(w, c.parameters)
    np.testing.assert_allclose(np.array(both[0]), np.array(both[1]), atol=1e-10)


@cache
def compiled_toy():
    return compiled(small_mpccs.toy()[0])


numbers = st.floats(-3, 3, allow_subnormal=False)


@settings(max_examples=50, deadline=None)
@given(w=st.tuples(numbers, numbers), lam_f=numbers, lam=numbers)
def test_product_rule(w, lam_f, lam):
    """T = G H and C = (G H)^2 of G = x, H = y: gradient 2 x y (y, x), and the Hessian of both by hand."""
    c = compiled_toy()
    z, none = ca.SX.sym('z', c.inner), ca.SX(0, 1)
    nlp = composed(c, Outer(z, none, none, (z[0] * z[1]) ** 2, z[0] * z[1]))
    gradient, jacobian, hessian = as_function(nlp.x, nlp.p, nlp.derivatives)(w, c.parameters, lam_f, lam)
    x, y = w
    np.testing.assert_allclose(np.array(gradient).ravel(), [2 * (x - 1) + 2 * x * y**2, 2 * (y - 1) + 2 * y * x**2], atol=1e-9)
    np.testing.assert_allclose(np.array(jacobian).ravel(), [y, x], atol=1e-12)
    off = lam_f * 4 * x * y + lam
    wanted = [[lam_f * (2 + 2 * y**2), off], [0, lam_f * (2 + 2 * x**2)]]
    np.testing.assert_allclose(np.array(hessian), wanted, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(a=numbers, b=numbers)
def test_the_hessian_is_linear_in_its_factors(a, b):
    c = compiled_toy()
    one, none = ca.DM.ones(c.inner), ca.DM(0, 1)
    pairs = (a, b), (a, 0.0), (0.0, b), (0.0, 0.0)
    h = [c.derivatives.hessian(ca.DM([0.7, 0.4]), none, ca.DM(of_cost), none, one).full() for of_cost in pairs]
    np.testing.assert_allclose(h[0] + h[3], h[1] + h[2], atol=1e-9)
