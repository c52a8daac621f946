"""Pyomo's expressions as casadi's have the same values."""

import casadi as ca
import pyomo.environ as pyo
import pytest
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.simulation.casadi_expressions import CasadiExpressions, Unsupported


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x, m.y, m.unused = pyo.Var(initialize=0.7), pyo.Var(initialize=1.3), pyo.Var()
    m.p = pyo.Param(initialize=2.5, mutable=True)
    m.named = pyo.Expression(expr=m.x * m.y + 1)
    m.empty = pyo.Expression()
    return m


EXPRESSIONS = {
    'sum': lambda m: m.x + 2 * m.y - 3 + m.p,
    'products': lambda m: (m.x - m.y) * (m.x + m.p) / (1 + m.y),
    'powers': lambda m: m.x**2 + m.y**m.x - m.p**m.y,
    'negation': lambda m: -(m.x**3),
    'named': lambda m: m.named * pyo.exp(m.named - m.x),
    'functions': lambda m: pyo.sqrt(m.x) + pyo.log(m.y) + pyo.log10(m.y) + pyo.tanh(m.x) + pyo.atan(m.y) + pyo.cos(m.x * m.y),
    'absolute': lambda m: abs(m.x - m.y),
    'variable': lambda m: m.x,
    'number': lambda m: 4,
}


@pytest.mark.parametrize('name', EXPRESSIONS)
def test_values(m, name):
    expr, symbols, met = EXPRESSIONS[name](m), {id(v): ca.SX.sym(v.name) for v in (m.x, m.y)}, {}
    function = ca.Function('f', list(symbols.values()), [CasadiExpressions(symbols).of(expr, met)])
    assert float(function(0.7, 1.3)) == pytest.approx(pyo.value(expr), rel=1e-14)
    assert set(met) == {id(v) for v in identify_variables(expr)}


UNSUPPORTED = {
    'acosh': lambda m: pyo.acosh(m.y),
    'if': lambda m: pyo.Expr_if(m.x >= 0, m.x, m.y),
    'nan': lambda m: float('nan') * m.x,
    'empty': lambda m: m.empty,
}


@pytest.mark.parametrize('name', UNSUPPORTED)
def test_unsupported(m, name):
    with pytest.raises(Unsupported):
        CasadiExpressions({id(v): ca.SX.sym(v.name) for v in (m.x, m.y)}).of(UNSUPPORTED[name](m), {})


def test_a_deep_expression(m):
    expr = m.x
    for _ in range(5000):
        expr = (expr + m.y) * 1.0001
    x, y = ca.SX.sym('x'), ca.SX.sym('y')
    function = ca.Function('f', [x, y], [CasadiExpressions({id(m.x): x, id(m.y): y}).of(expr, {})])
    assert float(function(0.0, 0.0)) == 0.0
