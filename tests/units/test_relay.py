"""Relays, relief valves and pumps against closed forms, each with its two thresholds."""

from itertools import accumulate
from math import log

import pyomo.environ as pyo
import pytest
import thermostat

import pyomo_fesd
from pyomo_fesd.units import pump, relay, relief_valve
from tests.units.support import assert_units_consistent, plant, rate, solved, switching_times, units


def test_a_heater_is_the_thermostat():
    m = plant(thermostat.HORIZON, y=15.0)
    m.Q = pyo.Var(m.t, initialize=10)
    m.heater = relay(m.t, signal=m.y, low=18, high=20, output=m.Q, on=10, acts='below', start='on')
    rate(m, 'y', lambda m, t: m.Q[t] - m.y[t] / 5)
    m = m.clone()
    assert switching_times(solved(m, nfe=15, clone=False, hysteresis=[m.heater])) == pytest.approx(
        thermostat.switching_times(), abs=1e-8
    )


def test_a_relief_valve_pops_and_reseats():
    """p' = 1 closed, p' = 1 - 2 p open; pops at 2, reseats at 1."""
    m = plant(4.5, units.bar, p=0.0)
    m.F = pyo.Var(m.t, initialize=0, units=units.bar / units.s)
    m.relief = relief_valve(m.t, pressure=m.p, opens=2, reseats=1, flow=m.F, capacity=lambda m, t: 2 / units.s * m.p[t])
    rate(m, 'p', lambda m, t: 1 * units.bar / units.s - m.F[t])
    assert_units_consistent(m.relief[0].open)
    m = solved(m, nfe=36, clone=False, hysteresis=[m.relief])
    falls, rises = log(3) / 2, 1.0  # from 2 to 1 towards 1/2, from 1 to 2
    assert switching_times(m) == pytest.approx(list(accumulate([2, falls, rises, falls])), abs=1e-6)
    names = [(s.before, s.after) for s in pyomo_fesd.switches(m)]
    assert names[:2] == [('closed', 'open'), ('open', 'closed')]


@pytest.mark.parametrize('fills, flows, times', [(False, 1.0, [2, 3, 5, 6]), (True, -1.0, [1, 2, 4, 5])])
def test_a_pump_between_two_level_switches(fills, flows, times):
    """A vessel with level 1 between switches at 0.. and 3: the inflow is 1 or -1, the pump 3 or 3."""
    m = plant(6.5, L=1.0)
    m.F = pyo.Var(m.t, initialize=0)
    m.pump = pump(m.t, level=m.L, low=1 if not fills else 0, high=3 if not fills else 2, flow=m.F, rate=3, fills=fills)
    rate(m, 'L', lambda m, t: flows + (m.F[t] if fills else -m.F[t]))
    m = solved(m, nfe=12, clone=False, hysteresis=[m.pump])
    assert switching_times(m) == pytest.approx(times, abs=1e-8)


@pytest.mark.parametrize(
    'given, said',
    [
        (dict(low=3, high=1), 'not below'),
        (dict(acts='sideways'), 'neither of'),
        (dict(start='open'), 'neither of'),
        (dict(output=1.0), 'is not a Var'),
    ],
)
def test_refused(given, said):
    m = plant(1, y=0.0)
    m.Q = pyo.Var(m.t)
    with pytest.raises(pyomo_fesd.FesdError, match=said):
        m.relay = relay(m.t, **(dict(signal=m.y, low=0, high=1, output=m.Q, on=1) | given))


def test_without_time_there_is_no_memory():
    with pytest.raises(pyomo_fesd.FesdError, match='needs a time'):
        relay(signal=1, low=0, high=1, output=None, on=1)
