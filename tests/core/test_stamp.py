"""Stamps: an expression of other components must be the one that the user would have written with them."""

import pyomo.environ as pyo
import pytest
from pyomo.core.expr.compare import compare_expressions

from pyomo_fesd.core.stamp import Stamp


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(4), initialize=1)
    m.p = pyo.Param(range(4), mutable=True, initialize=2.0)
    m.e = pyo.Expression(range(4), rule=lambda m, k: pyo.exp(m.x[k]) + 1)
    return m


@pytest.mark.parametrize(
    'rule',
    [
        lambda m, i, j: m.x[i],
        lambda m, i, j: 2 * m.x[i] + m.p[j] * m.x[j] - 3 == m.x[j],
        lambda m, i, j: pyo.sin(m.x[i]) ** 2 / (1 - m.x[j]) <= m.p[i] + m.p[j] * 3,
        lambda m, i, j: pyo.inequality(0, abs(m.x[i] - m.x[j]) * m.x[i], 5),
        lambda m, i, j: pyo.Expr_if(m.x[i] >= m.p[j], m.x[i] + m.x[j], -m.x[j]),
    ],
)
def test_an_expression_of_other_components(m, rule):
    stamp = Stamp([m.x[0], m.x[1], m.p[0], m.p[1]])
    first = rule(m, 0, 1)
    for i, j in ((2, 3), (3, 2), (0, 1)):
        assert compare_expressions(stamp.expression(first, [m.x[i], m.x[j], m.p[i], m.p[j]]), rule(m, i, j))


def test_named_expressions_are_parts_or_written_out(m):
    law = 2 * m.e[0] + m.x[0]
    assert compare_expressions(Stamp([m.e[0], m.x[0]]).expression(law, [m.e[1], m.x[1]]), 2 * m.e[1] + m.x[1])
    assert compare_expressions(Stamp([m.x[0]]).expression(law, [m.x[1]]), 2 * (pyo.exp(m.x[1]) + 1) + m.x[1])


def test_what_contains_no_part_is_shared(m):
    constant = m.p[3] + 1
    found = Stamp([m.x[0]]).expression(m.x[0] * constant, [m.x[1]])
    assert found.arg(0) is constant and Stamp([m.x[0]]).expression(5.0, [m.x[1]]) == 5.0


def test_place_of_a_part(m):
    assert Stamp([m.x[2], m.x[1]]).place(m.x[1]) == 1


def test_expressions_that_are_built_together_share_what_they_shared(m):
    common = pyo.exp(m.x[0])
    first = [m.x[0], common + m.p[0], 4.0, 2 * common <= m.p[0] * m.e[3], common]
    x, total, number, row, alone = Stamp([m.x[0], m.p[0]]).builder(first)([m.x[1], m.p[1]])
    assert x is m.x[1] and number == 4.0
    assert compare_expressions(total, pyo.exp(m.x[1]) + m.p[1])
    assert compare_expressions(row, 2 * pyo.exp(m.x[1]) <= m.p[1] * (pyo.exp(m.x[3]) + 1))
    assert total.arg(0) is alone is row.arg(0).arg(1)


@pytest.mark.parametrize('strict', [True, False])
def test_inequalities_stay_strict_or_not(m, strict):
    (row,) = Stamp([m.x[0]]).builder([pyo.inequality(m.x[0], 5, strict=strict)])([m.x[1]])
    assert row.strict is strict and row.arg(0) is m.x[1]
