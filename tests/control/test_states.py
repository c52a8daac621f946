"""What a measurement gives: fixed at the first time, free later, and no multiplier of a mode."""

from pyomo_fesd.control.states import first_states
from tests.problems import controlled_ramp


def test_states_are_the_initial_conditions():
    m = controlled_ramp.build(relay=True)
    m.u.fix(1.0)
    assert first_states(m, m.t) == [m.x[0], m.y[0]]
