"""Models that a solver must not ignore parts of: refused with component, cause and fix, and left as they were."""

from math import exp

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.solvers import refuse_unready


def model():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, 1), initialize=0.5)
    return m


def with_disjunction():
    m = model()
    m.a, m.b = Disjunct(), Disjunct()
    m.part = Disjunction(expr=[m.a, m.b])
    return m, 'part'


def with_disjunct():
    m = model()
    m.a = Disjunct()
    return m, 'a'


def with_logic():
    m = model()
    m.y = pyo.BooleanVar(initialize=True)
    m.logic = pyo.LogicalConstraint(expr=m.y)
    return m, 'logic'


def with_sos():
    m = model()
    m.z = pyo.Var([1, 2], bounds=(0, 1))
    m.sos = pyo.SOSConstraint(var=m.z, sos=1)
    return m, 'sos'


def with_integer():
    m = model()
    m.n = pyo.Var(domain=pyo.Integers)
    return m, 'n'


def with_derivative():
    m = model()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.s = pyo.Var(m.t)
    m.ds = dae.DerivativeVar(m.s)
    return m, 'ds'


def with_integral():
    m = model()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.s = pyo.Var(m.t)
    m.area = dae.Integral(m.t, wrt=m.t, rule=lambda m, t: m.s[t])
    return m, 'area'


@pytest.mark.parametrize(
    'build', [with_disjunction, with_disjunct, with_logic, with_sos, with_integer, with_derivative, with_integral]
)
def test_refused_with_its_name_and_a_fix(build):
    m, name = build()
    with pytest.raises(FesdError, match=rf'(?s)^{name}.*some_solver.*Fix: |^{name}.*\n    Fix: .*some_solver'):
        refuse_unready(m, 'some_solver')


@pytest.mark.parametrize('build', [with_disjunction, with_disjunct, with_logic, with_sos])
def test_not_refused_once_it_is_inactive(build):
    m, name = build()
    m.component(name).deactivate()
    for disjunct in m.component_objects(Disjunct):
        disjunct.deactivate()
    refuse_unready(m, 'some_solver')


def test_a_fixed_integer_is_not_refused():
    m, _ = with_integer()
    m.n.fix(1)
    refuse_unready(m, 'some_solver')


@pytest.mark.parametrize('solver', ['mpec_hybrid', 'casadi_ipopt'])
@pytest.mark.parametrize('referred', [False, True])
def test_an_integer_of_an_inactive_block_is_refused_if_an_equation_contains_it(referred, solver):
    m = pyo.ConcreteModel()
    m.b = pyo.Block()
    m.b.n = pyo.Var([1], domain=pyo.Integers, bounds=(0, 3), initialize=1)
    m.b.deactivate()
    m.x = pyo.Var(initialize=1.0)
    if referred:
        m.n = pyo.Reference(m.b.n)
    m.c = pyo.Constraint(expr=m.x == 0.5 * m.b.n[1])
    m.cost = pyo.Objective(expr=(m.x - 0.7) ** 2)
    with pytest.raises(FesdError, match=r'^b.n\[1\].*integer'):
        pyo.SolverFactory(solver).solve(m)


def test_a_plain_model_is_ready():
    refuse_unready(model(), 'some_solver')


def integrated(early):
    """x' = 1 on a sub-block with its own time, and an Integral that is used, declared before or after the discretisation."""
    m = pyo.ConcreteModel()
    m.b = pyo.Block()
    m.b.t = dae.ContinuousSet(bounds=(0, 1))
    m.b.x, m.b.area = pyo.Var(m.b.t), pyo.Var()
    m.b.dx = dae.DerivativeVar(m.b.x)
    m.b.law = pyo.Constraint(m.b.t, rule=lambda b, t: b.dx[t] == 2 * b.x[t])
    m.b.x[0].fix(1)

    def integral():
        m.b.sum = dae.Integral(m.b.t, rule=lambda b, t: b.x[t])
        m.b.total = pyo.Constraint(expr=m.b.area == m.b.sum)

    if early:
        integral()
    pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=20, ncp=3)
    if not early:
        integral()
    return m


def test_an_integral_that_pyomo_dae_did_not_build_again_is_refused_and_finite_elements_cure_it():
    m = integrated(early=True)
    with pytest.raises(pyomo_fesd.FesdError, match=r"b.sum: this Integral is a sum over the times that 'b.t' had before"):
        pyo.SolverFactory('casadi_ipopt').solve(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m)
    pyo.SolverFactory('casadi_ipopt').solve(m)
    assert m.b.area.value == pytest.approx((exp(2) - 1) / 2, rel=1e-7)


def test_an_integral_over_all_times_is_an_expression_wherever_it_lies():
    m = integrated(early=False)
    pyo.SolverFactory('casadi_ipopt').solve(m)
    assert m.b.area.value == pytest.approx((exp(2) - 1) / 2, rel=1e-3)  # pyomo.dae's trapezoids


def test_pairs_with_variables_that_scale_model_has_scaled_are_refused():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=1, bounds=(0, None)), pyo.Var(initialize=1)
    m.pair = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.sum = pyo.Constraint(expr=m.x + m.y == 1)
    m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
    m.scaling_factor[m.y] = 10
    scaled = pyo.TransformationFactory('core.scale_model').create_using(m)
    with pytest.raises(pyomo_fesd.FesdError, match="core.scale_model has scaled 'scaled_y' in Constraints only"):
        pyo.SolverFactory('mpec_hybrid').solve(scaled)
    m.scaling_factor[m.y] = 1
    pyo.SolverFactory('mpec_hybrid').solve(pyo.TransformationFactory('core.scale_model').create_using(m))
