"""Factors from values: x = 1e6 and y = 1e-2 with x y = 1e4."""

import pyomo.environ as pyo
import pytest

from pyomo_fesd.units import scale_by_values


def product():
    m = pyo.ConcreteModel()
    m.b = pyo.Block()
    m.b.x, m.y, m.zero = pyo.Var(initialize=1e6), pyo.Var(initialize=1e-2), pyo.Var(initialize=0)
    m.b.row = pyo.Constraint(expr=m.b.x * m.y == 1e4)
    return m


def test_variables_are_one_and_gradients_too():
    m = product()
    assert scale_by_values(m) == 3
    assert (m.b.scaling_factor[m.b.x], m.scaling_factor[m.y]) == pytest.approx((1e-6, 1e2))
    assert m.zero not in m.scaling_factor
    assert m.b.scaling_factor[m.b.row] == pytest.approx(1e-4)


def test_what_is_scaled_already_stays():
    m = product()
    m.scaling_factor = pyo.Suffix(direction=pyo.Suffix.EXPORT)
    m.scaling_factor[m.y] = 7.0
    assert scale_by_values(m) == 2 and scale_by_values(m) == 0
    assert m.scaling_factor[m.y] == 7.0
    assert m.b.scaling_factor[m.b.row] == pytest.approx(7e-6)


def test_equations_without_values_get_no_factor_and_are_told(caplog):
    m = pyo.ConcreteModel()
    m.x, m.y, m.z = pyo.Var(initialize=100.0), pyo.Var(), pyo.Var()
    m.z.fix()
    m.known = pyo.Constraint(expr=m.x**2 == 1e4)
    m.linear = pyo.Constraint(expr=4 * m.y == m.x)
    m.unknown = pyo.Constraint(expr=pyo.log(m.y) == m.x)
    m.given = pyo.Constraint(expr=m.z * m.x == 1)
    assert scale_by_values(m) == 3
    assert m.known in m.scaling_factor and m.scaling_factor[m.linear] == pytest.approx(0.01)
    assert m.unknown not in m.scaling_factor and m.given not in m.scaling_factor
    assert "2 equations" in caplog.text and "such as 'unknown', where 'y' has none" in caplog.text
    assert 'ERROR' not in caplog.text
