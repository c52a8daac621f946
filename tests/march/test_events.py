"""Arrivals at zero, and what a march does there."""

import bouncing_ball
import pyomo.environ as pyo
import pytest
import thermostat

import pyomo_fesd
from pyomo_fesd.elements.memory import LEFT
from pyomo_fesd.march.events import ZERO, Arrivals
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
    assert Arrivals().first('g', values) == place


@pytest.mark.parametrize('scale', [1e-6, 1.0, 1e6])
def test_zero_is_small_beside_what_has_been(scale):
    arrivals = Arrivals()
    assert arrivals.first('g', [scale, 2 * ZERO * scale]) is None
    assert arrivals.first('g', [scale, 0.5 * ZERO * scale]) == 1
    # what was large once counts later, for the same function only
    assert arrivals.first('g', [1e-5 * scale, 1e-8 * scale]) == 1
    assert arrivals.first('h', [1e-5 * scale, 1e-8 * scale]) is None


def test_the_law_of_switching_holds_at_the_values_of_a_march():
    m = thermostat.transform(thermostat.build(1), 5, 3)
    pyomo_fesd.simulate(m)
    law = m._pyomo_fesd_elements_t.memory
    heating = '_pyomo_fesd_dcs.relay_memory_2.weight[*,1]'
    ends = [0, *pyomo_fesd.element_lengths(m)['end']]
    left = min(range(6), key=lambda b: abs(ends[b] - thermostat.FIRST))
    frame = pyomo_fesd.trajectory(m).groupby(level=0).last()
    for b, time in enumerate(ends):
        y = frame['y'].iloc[abs(frame.index - time).argmin()]
        assert law.n[heating, b, 1, LEFT].value == pytest.approx(max(y - 20, 0), abs=1e-6)
        if 0 < b < 5:
            assert law.d[heating, b, 1, LEFT].value == float(b == left)
    for pair in (law.parts, law.region, law.leaving, law.binary):
        for condition in pair.values():
            assert min(pyo.value(side.args[1] if side.is_expression_type() else side) for side in condition._args) <= 1e-6


def test_jumps_happen_at_their_boundaries_only():
    m = move(bouncing_ball.build(), 10, 2)
    pyomo_fesd.simulate(m)
    ends = pyomo_fesd.element_lengths(m)['end']
    for (_, b), e in m._pyomo_fesd_elements_t.jumps.e.items():
        assert e.value == float(any(abs(ends[b] - t) <= 1e-6 for t in bouncing_ball.impacts()))
