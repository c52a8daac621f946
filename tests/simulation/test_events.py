"""Arrivals at zero, changes of mode and jumps there."""

import bouncing_ball
import pyomo.environ as pyo
import pytest
import thermostat

import pyomo_fesd
from pyomo_fesd.core import moving_grids
from pyomo_fesd.finite_elements.hysteresis import LEFT
from pyomo_fesd.simulation.events import ZERO, ZeroArrivals
from tests.models import dcs
from tests.problems import gears
from tests.problems.running import move


@pytest.mark.parametrize(
    'values, place',
    [
        ([3.0, 2.0, 1.0], None),
        ([3.0, 1.0, 0.0], 2),
        ([3.0, 0.0, 1.0], 1),
        ([3.0, 1.0, -1e-12], 2),
        ([0.0, 0.0, 0.0], None),  # at rest
        ([0.0, 1.0, 2.0], None),  # leaving
        ([0.0, 1.0, 0.0], 2),  # a hop
    ],
)
def test_an_arrival_is_a_fall_to_zero_from_above(values, place):
    assert ZeroArrivals().first('g', values) == place


@pytest.mark.parametrize('scale', [1e-6, 1.0, 1e6])
def test_zero_is_small_beside_what_has_been(scale):
    arrivals = ZeroArrivals()
    assert arrivals.first('g', [scale, 2 * ZERO * scale]) is None
    assert arrivals.first('g', [scale, 0.5 * ZERO * scale]) == 1
    # a large value counts later, for the same function only
    assert arrivals.first('g', [1e-5 * scale, 1e-8 * scale]) == 1
    assert arrivals.first('h', [1e-5 * scale, 1e-8 * scale]) is None


def test_the_hysteresis_conditions_hold_after_a_simulation():
    m = thermostat.transform(thermostat.build(1), 5, 3)
    pyomo_fesd.simulate(m)
    law = m._pyomo_fesd_elements_t.hysteresis
    heating = 'relay 1'
    ends = [0, *pyomo_fesd.element_lengths(m)['end']]
    frame = pyomo_fesd.trajectory(m).groupby(level=0).last()
    for b, time in enumerate(ends):
        y = frame['y'].iloc[abs(frame.index - time).argmin()]
        assert law.n[heating, b, 1, LEFT].value == pytest.approx(max(y - 20, 0), abs=1e-6)
    for pair in (law.parts, law.region, law.least, law.leaving, law.binary):
        for condition in pair.values():
            assert min(pyo.value(side.args[1] if side.is_expression_type() else side) for side in condition._args) <= 1e-6


def test_the_least_of_several_conditions_is_set_after_a_simulation():
    m = gears.build()
    move(dcs(m, hysteresis=[m.gear]), 14, 1)
    pyomo_fesd.simulate(m)
    law, grid = m._pyomo_fesd_elements_t.hysteresis, moving_grids(m)[m.t].grid
    for element in grid.elements[:-1]:
        v = m.v[element.right].value
        assert law.m['gear 2', element.n, 2].value == pytest.approx(max(min(v - 1, 5 - v), 0), abs=1e-6)


def test_jumps_happen_at_their_boundaries_only():
    m = move(bouncing_ball.build(), 10, 2)
    pyomo_fesd.simulate(m)
    ends = pyomo_fesd.element_lengths(m)['end']
    for (_, b), e in m._pyomo_fesd_elements_t.jumps.e.items():
        assert e.value == float(any(abs(ends[b] - t) <= 1e-6 for t in bouncing_ball.impacts()))
