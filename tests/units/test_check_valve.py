"""The pressure upstream rises at 1 bar/s from 0, that downstream starts at 1 bar: the valve opens at 1 s."""

from math import exp, log, tanh

import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd.units import check_valve
from tests.units.support import added, assert_units_consistent, plant, rate, solved, switching_times, units

END, R = 3, 0.5


def vessels(resistance, unit=None):
    """Downstream the flow raises the pressure; upstream it is made up for, except with the ideal valve."""
    m = plant(END, unit, p=0.0, q=1.0)
    m.F = pyo.Var(m.t, initialize=0, units=None if unit is None else unit / units.s)
    rate(m, 'p', lambda m, t: 1 - (m.F[t] if resistance is None else 0))
    rate(m, 'q', lambda m, t: m.F[t])
    m.valve = check_valve(m.t, upstream=m.p, downstream=m.q, flow=m.F, resistance=resistance)
    return m


@pytest.mark.parametrize(
    'resistance, flow',
    [
        (None, 0.5),  # p = q rise together
        (R, 1 - exp(-(END - 1) / R)),
        (lambda F: F**2, tanh(1.0)),  # the drop d: d' = 1 - sqrt(d); only near the end checked below
    ],
)
def test_it_opens_at_its_time_and_never_lets_back(resistance, flow):
    m = solved(vessels(resistance), nfe=16)
    assert switching_times(m) == pytest.approx([1], abs=1e-9)
    assert min(F.value for F in m.F.values()) >= -1e-9
    assert added(m.valve[END]) == (0, 0, 1)
    if not callable(resistance):
        assert m.F[END].value == pytest.approx(flow, abs=1e-5)


def test_turbulent_law_keeps_its_first_integral():
    """From d' = 1 - sqrt(d): with F = sqrt(d), -F - log(1 - F) = (t - 1)/2."""
    m = solved(vessels(lambda F: F**2), nfe=60)
    F = m.F[END].value
    assert -F - log(1 - F) == pytest.approx((END - 1) / 2, abs=1e-3)  # F starts like a root of the time


def test_units():
    m = vessels(R * units.s, units.bar)
    assert_units_consistent(m.valve[0])


def test_refused():
    m = plant(1, p=0.0)
    with pytest.raises(pyomo_fesd.FesdError, match='is not a Var'):
        m.valve = check_valve(m.t, upstream=m.p, downstream=0, flow=3.0)
