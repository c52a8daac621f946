"""Expressions that are recognised as absolute values, and similar ones that are not."""

import pyomo.environ as pyo
import pytest

from pyomo_fesd.smoothing.patterns import guards, match


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=0.3), pyo.Var(initialize=-1.7)
    m.eps = pyo.Param(initialize=1e-3, mutable=True)
    m.small = pyo.Param(initialize=1e-3)
    m.empty = pyo.Param(mutable=True)
    m.held = pyo.Var(initialize=1e-3)
    m.held.fix()
    return m


@pytest.mark.parametrize(
    'write, z, eps',
    [
        (lambda m: abs(m.x), 'x', 0),
        (lambda m: pyo.sqrt(m.x**2 + 1e-6), 'x', 1e-3),
        (lambda m: (m.x**2 + 1e-6) ** 0.5, 'x', 1e-3),
        (lambda m: (1e-6 + m.x**2) ** 0.5, 'x', 1e-3),
        (lambda m: pyo.sqrt(m.x * m.x + 1e-6), 'x', 1e-3),
        (lambda m: pyo.sqrt((m.x - m.y) * (m.x - m.y) + 1e-6), 'x - y', 1e-3),
        (lambda m: pyo.sqrt(m.x**2), 'x', 0),
        (lambda m: (m.x**2 + m.eps**2) ** 0.5, 'x', 1e-3),
        (lambda m: (m.x**2 + m.small**2) ** 0.5, 'x', 1e-3),
        (lambda m: (m.x**2 + m.held**2) ** 0.5, 'x', 1e-3),
        (lambda m: ((m.x * m.y) ** 2 + m.eps**2 + 3e-6) ** 0.5, 'x*y', 2e-3),
        (lambda m: pyo.sqrt(m.x**2 + 1), 'x', 1),
    ],
)
def test_recognised(m, write, z, eps):
    found = match(write(m))
    assert (str(found.z), found.eps) == (z, pytest.approx(eps))


@pytest.mark.parametrize(
    'write',
    [
        lambda m: pyo.sqrt(m.x**2 + m.y**2),
        lambda m: pyo.sqrt(m.x**2 + m.y**2 + 1e-6),
        lambda m: pyo.sqrt(m.x**2 + m.y),
        lambda m: pyo.sqrt(m.x**2 + m.x + 1e-6),
        lambda m: pyo.sqrt(2 * m.x**2 + 1e-6),
        lambda m: pyo.sqrt(m.x**2 - 1e-6),
        lambda m: pyo.sqrt(m.x**2 + m.empty),
        lambda m: pyo.sqrt(m.x * m.y + 1e-6),
        lambda m: pyo.sqrt(m.x),
        lambda m: pyo.exp(m.x**2 + 1e-6),
        lambda m: (m.x**2 + 1e-6) ** 1.5,
        lambda m: (m.x**2 + 1e-6) ** m.y,
        lambda m: (m.x**4 + 1e-6) ** 0.5,
        lambda m: m.x**2 + 1e-6,
    ],
)
def test_not_recognised(m, write):
    assert match(write(m)) is None


def test_a_fixed_z_is_recognised_too(m):
    m.x.fix()  # the initial state, at the first time
    assert match(pyo.sqrt(m.x**2 + 1e-6)).z is m.x


@pytest.mark.parametrize(
    'write, positions',
    [
        (lambda m: pyo.sqrt(m.x), {0}),
        (lambda m: pyo.log(m.x), {0}),
        (lambda m: pyo.log10(m.x), {0}),
        (lambda m: pyo.exp(m.x), set()),
        (lambda m: m.y / m.x, {1}),
        (lambda m: m.x**0.25, {0}),
        (lambda m: m.x**-1, {0}),
        (lambda m: m.x**m.y, {0}),
        (lambda m: m.x**m.eps, {0}),
        (lambda m: m.x**3, set()),
        (lambda m: m.x * m.y, set()),
        (lambda m: abs(m.x), set()),
    ],
)
def test_arguments_that_are_kept_away_from_zero(m, write, positions):
    node = write(m)
    assert {i for i in range(node.nargs()) if guards(node, i)} == positions
