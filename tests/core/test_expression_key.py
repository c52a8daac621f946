"""Keys of expressions: the analysis of one time, reused for the others, must equal an analysis of each time."""

import sys
from concurrent.futures import ThreadPoolExecutor

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.core.expr.compare import compare_expressions
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunction

from pyomo_fesd.core.errors import FesdError
from pyomo_fesd.core.expression_key import component_key, exchanged, expression_key
from pyomo_fesd.core.stamp import Stamp


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(4), initialize=1)
    m.p = pyo.Param(range(4), mutable=True, initialize={0: 1.0, 1: 1.0, 2: 2.0, 3: 2.0})
    m.e = pyo.Expression(range(4), rule=lambda m, k: pyo.exp(m.x[k]))
    return m


def of(*expressions, kind=lambda v: None):
    return expression_key(expressions, kind)[0]


@pytest.mark.parametrize(
    'rule',
    [
        lambda m, i, j: 2 * m.x[i] - 3 <= m.x[j],
        lambda m, i, j: pyo.sin(m.x[i]) ** 2 / m.x[j] == 5,
        lambda m, i, j: m.e[i] - abs(m.x[j]) >= m.x[i] * m.x[j],
        lambda m, i, j: m.p[0] * m.x[i] + m.x[j] + 1 == 0,
    ],
)
def test_other_variables_have_the_same_key_and_can_be_put_in(m, rule):
    (key, parts), (other, others) = (expression_key([rule(m, *ij)], lambda v: None) for ij in ((0, 1), (2, 3)))
    assert key == other
    assert compare_expressions(Stamp(parts).expression(rule(m, 0, 1), others), rule(m, 2, 3))


@pytest.mark.parametrize(
    'one, other',
    [
        (lambda m: m.x[0] + m.x[1] <= 0, lambda m: m.x[0] + m.x[0] <= 0),
        (lambda m: m.x[0] <= 0, lambda m: m.x[0] < 0),
        (lambda m: m.x[0] <= 1, lambda m: m.x[0] <= 2),
        (lambda m: pyo.sin(m.x[0]), lambda m: pyo.cos(m.x[0])),
        (lambda m: m.p[0] * m.x[0], lambda m: m.p[2] * m.x[0]),
        (lambda m: m.e[0], lambda m: pyo.exp(m.x[0])),
        (lambda m: m.x[0] - 0 * m.x[1] + 3, lambda m: m.x[0] + 3),
    ],
)
def test_what_differs_has_another_key(m, one, other):
    assert of(one(m)) != of(other(m))


def test_the_kind_of_a_variable_belongs_to_the_key(m):
    state = lambda v: v is m.x[0]  # noqa: E731
    assert of(m.x[0] + 1, kind=state) != of(m.x[1] + 1, kind=state)
    assert of(m.x[2] + 1, kind=state) == of(m.x[1] + 1, kind=state)


def test_of_an_unknown_node_there_is_no_key(m):
    assert of(pyo.Expr_if(IF=m.x[0] >= 0, THEN=1.0, ELSE=m.x[1])) is None


def test_a_component_key_is_that_of_the_same_components(m):
    assert component_key(pyo.exp(m.x[0]) * m.p[0]) == component_key(pyo.exp(m.x[0]) * m.p[0])
    assert component_key(pyo.exp(m.x[0])) != component_key(pyo.log(m.x[0]))
    assert component_key(m.x[0] ** 2) != component_key(m.x[1] ** 2)
    assert component_key(m.p[0] * m.x[0]) != component_key(m.p[1] * m.x[0])


def test_a_component_key_does_not_enter_named_expressions(m):
    m.same = pyo.Expression(expr=pyo.exp(m.x[0]))
    before = component_key(2 * m.e[0])
    assert before != component_key(2 * m.same)
    m.e[0].set_value(m.x[1])
    assert component_key(2 * m.e[0]) == before


def relay(level, gain):
    """dx/dt = -gain(t) on one side of level(t), 1 on the other."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1, 2, 3])
    m.x = pyo.Var(m.t, initialize=0.5)
    m.dx = dae.DerivativeVar(m.x)
    m.relay = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] >= level(t), gain(t) * m.dx[t] == -m.x[t]],
            [m.x[t] <= level(t), gain(t) * m.dx[t] == 1],
        ],
    )
    return m


def test_numbers_that_differ_from_time_to_time_stay_what_they_are():
    m = relay(lambda t: 1 + t, lambda t: 2.0**t)
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    dcs = m._pyomo_fesd_dcs.relay
    m.x[2].set_value(7.0)
    dcs.alpha[2].set_value(1.0)
    dcs.p[2].set_value(4.0)
    dcs.n[2].set_value(0.0)
    assert pyo.value(dcs.switching[2].body) == pytest.approx(pyo.value(dcs.switching[2].upper))
    m.dx[2].set_value(-7 / 4)
    assert pyo.value(dcs.mode[2, 1].body) == pytest.approx(pyo.value(dcs.mode[2, 1].upper))


def test_a_fault_at_a_later_time_is_found():
    with pytest.raises(FesdError, match='overlap'):
        m = relay(lambda t: 1.0, lambda t: 1.0)
        m.relay[3].disjuncts[1].constraint[1].set_value(m.x[3] <= 2)
        pyo.TransformationFactory('fesd.dcs').apply_to(m)


def test_exchanges_do_not_know_of_one_another(m):
    law = m.x[0] + m.e[1]
    assert compare_expressions(exchanged(law, {id(m.x[0]): m.x[2]}), m.x[2] + pyo.exp(m.x[1]))
    assert compare_expressions(exchanged(law, {id(m.x[1]): m.x[3]}), m.x[0] + pyo.exp(m.x[3]))
    assert exchanged(2.0, {}) == 2.0 and exchanged(m.x[0], {id(m.x[0]): 1.0}) == 1.0


def test_threads_exchange_components_at_the_same_time():
    def exchange(k):
        m = pyo.ConcreteModel()
        m.x, m.y = pyo.Var(range(40)), pyo.Var(range(40))
        found = exchanged(sum(v**2 for v in m.x.values()), {id(m.x[i]): m.y[i] for i in m.x})
        return {id(v) for v in identify_variables(found)} == {id(v) for v in m.y.values()}

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            assert all(pool.map(exchange, range(200)))
    finally:
        sys.setswitchinterval(interval)
