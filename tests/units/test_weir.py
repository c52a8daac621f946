"""Filling at 0.4 m3/s from 0.5 m3 to the crest at 1 m3, reached at 1.25 s."""

from math import exp

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd.units import weir
from tests.units.support import added, assert_units_consistent, plant, rate, solved, switching_times, units

CUBIC, FLOW = units.m**3, units.m**3 / units.s
END, INFLOW, STARTS, SLOPE = 3, 0.4, 1.25, 2.0
#: Volume at the end where the overflow is SLOPE times the head.
END_WITH_LAW = 1 + INFLOW / SLOPE * (1 - exp(-SLOPE * (END - STARTS)))


def tank(**given):
    m = plant(END, CUBIC, V=0.5)
    m.F = pyo.Var(m.t, initialize=0, units=FLOW)
    rate(m, 'V', lambda m, t: INFLOW * FLOW - m.F[t])
    m.weir = weir(m.t, **(dict(level=m.V, crest=1.0, flow=m.F) | given))
    return m


@pytest.mark.parametrize(
    'given, end, size',
    [
        ({}, 1.0, (0, 0, 1)),
        (dict(resistance=units.s / SLOPE), END_WITH_LAW, (0, 0, 1)),
        (dict(resistance=lambda F: F * units.s / SLOPE), END_WITH_LAW, (0, 0, 1)),
        (dict(discharge=lambda h: SLOPE / units.s * h), END_WITH_LAW, (1, 1, 1)),
    ],
)
def test_overflow_starts_at_its_time_and_follows_the_law(given, end, size):
    m = solved(tank(**given))
    assert switching_times(m) == pytest.approx([STARTS], abs=1e-9)
    assert m.V[END].value == pytest.approx(end, abs=5e-6)
    assert added(m.weir[END]) == size
    if not given:
        assert max(v.value for v in m.V.values()) == pytest.approx(1, abs=1e-9)
        assert m.F[END].value == pytest.approx(INFLOW, abs=1e-9)


def test_it_converges_with_the_order_of_the_scheme():
    m = solved(tank(resistance=units.s / SLOPE), nfe=24)
    assert m.V[END].value == pytest.approx(END_WITH_LAW, abs=1e-8)


@pytest.mark.parametrize('crest', [1.0, units.m**3, lambda m, t: 1.0 * units.m**3])
def test_units(crest):
    m = tank(crest=crest, discharge=lambda h: SLOPE / units.s * h)
    assert_units_consistent(m.weir[0])


def test_on_a_discretised_model_and_without_time():
    m = tank()
    m.del_component(m.weir)
    pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=8, ncp=3)
    m.weir = weir(m.t, level=m.V, crest=1.0, flow=m.F)
    assert switching_times(solved(m)) == pytest.approx([STARTS], abs=1e-9)

    m = pyo.ConcreteModel()
    m.V, m.F = pyo.Var(initialize=1, bounds=(0, 5)), pyo.Var(initialize=1)
    m.weir = weir(level=m.V, crest=1.0, flow=m.F, resistance=0.5)
    m.cost = pyo.Objective(expr=(m.F - 1) ** 2)
    assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B'
    assert (m.V.value, m.F.value) == pytest.approx((1.5, 1.0), abs=1e-6)


def test_a_level_in_blocks_given_as_a_reference():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, END))
    m.state = pyo.Block(m.t, rule=lambda b, t: b.add_component('V', pyo.Var(initialize=0.5)))
    m.V, m.F = pyo.Reference(m.state[:].V), pyo.Var(m.t, initialize=0)
    m.dV = dae.DerivativeVar(m.V, wrt=m.t)
    m.V[0].fix(0.5)
    rate(m, 'V', lambda m, t: INFLOW - m.F[t])
    m.weir = weir(m.t, level=m.V, crest=1.0, flow=m.F, resistance=1 / SLOPE)
    m = solved(m)
    assert switching_times(m) == pytest.approx([STARTS], abs=1e-9)
    assert m.V[END].value == pytest.approx(END_WITH_LAW, abs=5e-6)


def elsewhere():
    """A level that is not over time."""
    level = pyo.Param([7], initialize=1)
    level.construct()
    return level


@pytest.mark.parametrize(
    'given, said',
    [
        (dict(flow=lambda m, t: 2 * m.F[t]), 'is not a Var'),
        (dict(resistance=1, discharge=1), 'both a resistance and a discharge'),
        (dict(level=elsewhere()), 'has no index'),
    ],
)
def test_refused(given, said):
    with pytest.raises(pyomo_fesd.FesdError, match=said):
        tank(**given)
