"""A command that rises from 0 to 1 in 1 s, split at 0.4: the integrals of the openings are 0.2 and 0.3."""

import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd.units import split_range
from tests.units.support import added, assert_units_consistent, plant, rate, solved, switching_times, units


def two_valves(unit=None, split=0.4):
    m = plant(1, unit, u=0.0, a=0.0, b=0.0)
    m.first, m.second = pyo.Var(m.t, initialize=0.5), pyo.Var(m.t, initialize=0.5)
    m.range = split_range(m.t, command=m.u, first=m.first, second=m.second, split=split)
    rate(m, 'u', lambda m, t: 1)
    rate(m, 'a', lambda m, t: m.first[t])
    rate(m, 'b', lambda m, t: m.second[t])
    return m


def test_one_works_at_a_time():
    m = solved(two_valves())
    assert switching_times(m) == pytest.approx([0.4], abs=1e-9)
    assert (m.a[1].value, m.b[1].value) == pytest.approx((0.2, 0.3), abs=1e-9)
    assert (m.first[0].value, m.second[1].value) == pytest.approx((1, 1), abs=1e-9)
    assert added(m.range[1]) == (0, 1, 1)


def test_units():
    m = plant(1, units.mA, u=0.0)
    m.first, m.second = pyo.Var(m.t), pyo.Var(m.t)
    m.range = split_range(m.t, command=m.u, first=m.first, second=m.second, low=4, split=12, high=20)
    assert_units_consistent(m.range[0])


def test_refused():
    with pytest.raises(pyomo_fesd.FesdError, match='split = 1.2 is not below high'):
        two_valves(split=1.2)
