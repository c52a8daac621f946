"""A command that falls from 2 to -1 at rate 1, and a state that integrates the output."""

import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pyomo_fesd
from pyomo_fesd.units import saturation
from tests.units.support import added, assert_units_consistent, plant, rate, solved, switching_times, units


def actuator(unit=None, **limits):
    m = plant(3, unit, u=2.0, x=0.0)
    m.v = pyo.Var(m.t, initialize=0.5, units=unit)
    m.valve = saturation(m.t, command=m.u, output=m.v, **limits)
    rate(m, 'u', lambda m, t: -1)
    rate(m, 'x', lambda m, t: m.v[t])
    return m


@pytest.mark.parametrize(
    'limits, times, end, size',
    [
        (dict(low=0, high=1), [1, 2], 1.5, (1, 0, 2)),
        (dict(low=0), [2], 2.0, (0, 0, 1)),
        (dict(high=1), [1], 1.0, (0, 0, 1)),
    ],
)
def test_it_saturates_exactly(limits, times, end, size):
    m = solved(actuator(**limits))
    assert switching_times(m) == pytest.approx(times, abs=1e-9)
    assert m.x[3].value == pytest.approx(end, abs=1e-9)
    exact = [min(max(m.u[t].value, limits.get('low', -9)), limits.get('high', 9)) for t in m.t]
    assert [m.v[t].value for t in m.t] == pytest.approx(exact, abs=1e-9)
    assert added(m.valve[3]) == size


def test_it_is_smaller_than_clip():
    """One variable, where ``clip`` has two."""
    m = actuator(low=0, high=1)
    m.del_component(m.valve)

    @m.Block(m.t)
    def valve(b, t):
        b.limits = pyo.Constraint(expr=b.model().v[t] == pyomo_fesd.clip(b, b.model().u[t], 0, 1))

    reports = []
    for plain in (actuator(low=0, high=1), m):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(plain, nfe=8, ncp=3)
        reports.append(pyomo_fesd.report(plain))
    small, large = reports
    times = 1 + 8 * 3
    assert large['variables'] - small['variables'] == times
    assert (large['constraints'], large['pairs']) == (small['constraints'], small['pairs'])


@settings(max_examples=40, deadline=None)
@given(st.floats(-3, 3), st.floats(-2, 0), st.floats(0.01, 2))
def test_the_pairs_say_mid(u, low, width):
    """min(high, max(low, u)) fulfils both pairs, and is the only value that does."""
    high = low + width
    s, v = max(0, u - low) / width, min(max(u, low), high)
    pairs = [(s, s - (u - low) / width), ((high - v) / width, s - (v - low) / width)]
    assert all(min(pair) >= -1e-12 and min(map(abs, pair)) <= 1e-12 for pair in pairs)


def test_units():
    m = actuator(units.m, low=0.5, high=1.0)
    assert_units_consistent(m.valve[0])
    assert str(units.get_units(m.valve[0].s)) == 'dimensionless'


@pytest.mark.parametrize('limits, said', [({}, 'no limit'), (dict(low=1, high=0), 'not below')])
def test_refused(limits, said):
    with pytest.raises(pyomo_fesd.FesdError, match=said):
        actuator(**limits)
