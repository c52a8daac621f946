"""Models that a solver must not ignore parts of: refused with component, cause and fix, and left as they were."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.gdp import Disjunct, Disjunction

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


def test_a_plain_model_is_ready():
    refuse_unready(model(), 'some_solver')
