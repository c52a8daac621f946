"""Sources that are built alike must get what each would get alone."""

import pyomo.environ as pyo
import pytest
from pyomo.core.expr.compare import compare_expressions
from pyomo.environ import units as u
from pyomo.util.check_units import assert_units_equivalent

TIMES = range(4)


def smooth_maximum(a, b, eps):
    return 0.5 * (a + b + ((a - b) ** 2 + eps**2) ** 0.5)


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(TIMES, initialize=lambda m, t: t - 1.5), pyo.Var(TIMES)
    m.eps = pyo.Var(TIMES, initialize=1e-4)
    m.eps.fix()
    m.flow = pyo.Constraint(TIMES, rule=lambda m, t: m.y[t] == smooth_maximum(m.x[t], abs(m.x[t] - 1), m.eps[t]))
    return m


def transform(m, **options):
    return pyo.TransformationFactory('fesd.smooth_to_complementarity').apply_to(m, **options)


def alone(m, t):
    """The same with one time only, which is never a copy."""
    other = m.clone()
    for index in TIMES:
        if index != t:
            del other.flow[index]
    transform(other)
    return other


def generated(m):
    return m.component('_pyomo_fesd_kinks').flow


def test_copies_are_what_each_would_be_alone(m):
    transformed = m.clone()
    assert transform(transformed).pairs == 2 * len(TIMES)
    for t in TIMES:
        other, block = alone(m, t), generated(transformed)
        assert str(other.flow[t].expr) == str(transformed.flow[t].expr)
        for index, pair in generated(other).complementarity.items():
            assert [str(side) for side in pair._args] == [str(side) for side in block.complementarity[index]._args]
            assert generated(other).s[index].value == block.s[index].value


def test_other_bounds_are_another_pattern(m):
    m.x[2].setlb(1.0)
    summary = transform(m)
    assert summary.pairs == 2 * (len(TIMES) - 1)  # |x - 1| = x - 1 there, and x is larger
    assert len(generated(m).complementarity) == summary.pairs


def test_another_smoothing_is_another_pattern(m):
    m.eps[3].fix(0.5)
    transform(m)
    assert len([index for index in generated(m).complementarity if index[0] == 3]) == 1


def test_units_of_copies():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(TIMES, units=u.m, initialize=1), pyo.Var(TIMES, units=u.m)
    m.flow = pyo.Constraint(TIMES, rule=lambda m, t: m.y[t] == abs(m.x[t] - 2 * u.m))
    transform(m)
    for t in TIMES:
        assert_units_equivalent(m.flow[t].body, u.m)
        assert_units_equivalent(generated(m).complementarity[t, 1]._args[1].args[1], u.dimensionless)
    assert compare_expressions(m.flow[1].expr.arg(0), m.y[1])
