"""The simulated plant: one interval after the other is the simulation of all of them."""

import pytest

import pyomo_fesd
from pyomo_fesd import Plant
from tests.problems import controlled_ramp


def test_intervals_one_after_the_other_are_one_simulation():
    whole = controlled_ramp.build(stages=4, elements=6, relay=True)
    known = pyomo_fesd.simulate(whole, inputs=[whole.u])
    m = controlled_ramp.build(stages=1, elements=6, relay=True)
    plant = Plant(m, [m.u])
    assert plant.modes == ['heating']
    for _ in range(4):
        plant.advance({m.u: 1.0})
    found = plant.trajectory()
    assert plant.time == 2.0 and found.index[-1] == pytest.approx(2.0)
    assert plant.measured.get_data_from_key('x[*]') == pytest.approx(known['x'].iloc[-1], abs=1e-6)
    assert plant.measured.get_data_from_key('y[*]') == pytest.approx(known['y'].iloc[-1], abs=1e-4)
    heats = known['relay: heating'].iloc[-1] > 0.5
    assert plant.modes == ['heating' if heats else 'cooling']
