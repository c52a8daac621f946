"""Gradients of many expressions together are those of each alone."""

import math

import pyomo.environ as pyo
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pyomo_fesd.core import gradient, gradients
from pyomo_fesd.core.gradients import ALIKE

FORMS = {
    'constant': lambda m, i: 3 + m.p[i],
    'linear': lambda m, i: 2 * m.x[i] - m.y + 1,
    'own number': lambda m, i: i * m.x[i] ** 2 + m.y,
    'param': lambda m, i: m.p[i] * m.x[i] * m.y,
    'named': lambda m, i: m.e[i] * m.y / (2 + m.e[i] ** 2),
    'function': lambda m, i: pyo.tanh(m.x[i]) * pyo.exp(-m.y),
    'absolute value': lambda m, i: abs(m.x[i]) + m.x[i],
    'condition': lambda m, i: pyo.Expr_if(m.x[i] >= 0.1, m.x[i] * m.y, 0),
    'same variable': lambda m, i: m.x[i] * m.x[i],
    'two variables': lambda m, i: m.x[i] * m.y,
    'variable or number': lambda m, i: m.x[i] + (m.y if i % 2 else 1),
    'root': lambda m, i: pyo.sqrt(m.x[i]),
}
COUNT = ALIKE + 2
VALUES = st.one_of(st.none(), st.floats(-3, 3).map(lambda x: round(x, 3)))


def model(xs, y):
    m = pyo.ConcreteModel()
    m.I = pyo.RangeSet(0, COUNT - 1)
    m.x, m.y = pyo.Var(m.I, initialize=lambda m, i: xs[i]), pyo.Var(initialize=y)
    m.p = pyo.Param(m.I, initialize=lambda m, i: i % 2 + 1.0, mutable=True)
    m.e = pyo.Expression(m.I, rule=lambda m, i: m.x[i] ** 2 + m.p[i])
    return m


@given(st.lists(st.sampled_from(sorted(FORMS)), min_size=1, max_size=4), st.lists(VALUES, min_size=COUNT, max_size=COUNT))
def test_each_has_its_own_variables_and_slopes(names, xs):
    m = model(xs, 1.5)
    expressions = [FORMS[name](m, i) for i in m.I for name in names]
    for expression, (variables, slopes) in zip(expressions, gradients(expressions)):
        alone = gradient(expression, variables) if variables else []
        assert slopes == pytest.approx(alone, rel=1e-12, abs=1e-12, nan_ok=True)
        of_y = [v for v in variables if v is m.y]
        assert len({id(v) for v in variables}) == len(variables) and len(of_y) <= 1


def test_fixed_variables_count():
    m = model([1.0] * COUNT, 2.0)
    m.y.fix()
    for i, (variables, slopes) in enumerate(gradients(m.x[i] * m.y for i in m.I)):
        assert dict(zip((v.name for v in variables), slopes)) == {f'x[{i}]': 2.0, 'y': 1.0}


def test_many_without_a_value_have_no_gradient():
    m = model([None] * COUNT, 2.0)
    assert all(math.isnan(slope) for _, slopes in gradients(m.x[i] ** 2 for i in m.I) for slope in slopes)


def test_no_expressions_have_no_gradients():
    assert gradients([]) == []
