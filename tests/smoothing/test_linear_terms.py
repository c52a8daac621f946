"""Linear combinations with like terms collected."""

import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyomo_fesd.smoothing.linear_terms import LinearCombination


def model():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=0.3), pyo.Var(initialize=-1.7)
    m.p = pyo.Param(initialize=2.5, mutable=True)
    m.e = pyo.Expression(expr=m.x**2)
    return m


@pytest.mark.parametrize(
    'write, collected',
    [
        (lambda m: 0.5 * (m.x + m.y + (m.x - m.y)), 'x'),
        (lambda m: (m.x + m.y - (m.x - m.y)) / 2, 'y'),
        (lambda m: m.x * m.y + 2 * m.x - m.x * m.y, '2*x'),
        (lambda m: m.e - 3 * m.e + 1, '-2*(x**2) + 1'),
        (lambda m: m.p - m.x - (m.p + 4), '- x - 4'),
        (lambda m: m.p * m.x - m.x * m.p, '0'),
        (lambda m: m.y - 2 * (m.p * m.x) + 2 * m.p * m.x, 'y'),
        (lambda m: (-m.x) / m.p + m.x / m.p, '0'),
        (lambda m: m.x * m.y - m.y * m.x, 'x*y - (y*x)'),  # structure, not algebra
        (lambda m: 0 - (-m.x), 'x'),
        (lambda m: m.x - m.x, '0'),
        (lambda m: 7, '7'),
    ],
)
def test_like_terms_are_collected(write, collected):
    assert str(LinearCombination(write(model())).expression()) == collected


def test_a_named_expression_is_itself_whatever_it_holds():
    m = model()
    m.same = pyo.Expression(expr=m.x**2)
    terms = LinearCombination(m.e - m.same)
    m.same.set_value(m.y)
    assert len(terms.parts()) == 2 and pyo.value(terms.expression()) == pytest.approx(0.09 + 1.7)


def test_the_key_does_not_depend_on_the_order_and_knows_the_sign():
    m = model()
    a, b = LinearCombination(m.x - 2 * m.y + 1), LinearCombination(1 - m.y * 2 + m.x)
    assert a.key() == b.key() and a.key(-1) == LinearCombination(2 * m.y - m.x - 1).key() and a.key() != a.key(-1)


def test_terms_of_terms():
    m = model()
    assert str(LinearCombination(m.x + 1).add(LinearCombination(m.y - m.x), 1).add(LinearCombination(m.y), -1).expression()) == '1'


@st.composite
def linear(draw, depth=3):
    """A function from a model to an expression of sums, differences, multiples and quotients."""
    if depth == 0:
        return draw(
            st.sampled_from([lambda m: m.x, lambda m: m.y, lambda m: m.p, lambda m: m.x * m.y, lambda m: m.e, lambda m: 3.0])
        )
    a, b = draw(linear(depth=depth - 1)), draw(linear(depth=depth - 1))
    c = draw(st.sampled_from([-2.0, 0.5, 1.0, 4.0]))
    kinds = [lambda m: a(m) + b(m), lambda m: a(m) - b(m), lambda m: c * a(m), lambda m: a(m) / c, lambda m: -a(m)]
    return draw(st.sampled_from(kinds))


@settings(max_examples=60, deadline=None)
@given(linear())
def test_collecting_does_not_change_the_value(write):
    m = model()
    assert pyo.value(LinearCombination(write(m)).expression()) == pytest.approx(pyo.value(write(m)), abs=1e-12)
