"""Modes with hysteresis at the first time: loaded, read, and refused where they are no such modes."""

import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd import FesdError, MovingModelInterface
from tests.problems import controlled_ramp


def test_a_loaded_mode_is_that_of_the_first_element():
    m = controlled_ramp.build(relay=True)
    interface = MovingModelInterface(m)
    for mode, slope in (('cooling', -1), ('heating', 1), (m.cooling, -1), (m.heating[0], 1)):
        interface.load_modes([mode])
        pyomo_fesd.simulate(m, inputs=[m.u])
        assert interface.modes_at_first_time() == ['heating' if slope > 0 else 'cooling']
        assert (m.y[m.t.at(2)].value - 1.0) * slope > 0
    assert interface.modes_at_end() in (['heating'], ['cooling'])
    # all points of the first element share one
    assert len(interface.mode_multipliers) == 1


def test_what_is_no_mode_is_refused():
    m = controlled_ramp.build(relay=True)
    interface = MovingModelInterface(m)
    with pytest.raises(FesdError, match="warming.*not a mode with hysteresis"):
        interface.load_modes(['warming'])
    with pytest.raises(FesdError, match="of the same Disjunction, is given too"):
        interface.load_modes(['heating', 'cooling'])


def test_a_product_with_a_parameter_that_is_zero_fixes_nothing():
    """With the first mode a parameter, sides are its products with multipliers: at zero they do not depend on these."""
    # nearer to the kink the solution leaves it on a boundary of stages, which is not certified with hysteresis
    m = controlled_ramp.control_problem(relay=True, elements=4)
    controller = pyomo_fesd.Controller(m, [m.u])
    for mode in ('cooling', 'heating', 'cooling'):
        answer = controller.step({'x[*]': -2.2, 'y[*]': 1.0}, [mode], time_limit=30)
        assert answer.origin in ('branch', 'simulated branch'), answer.reason
        assert m.heating[0].indicator_var.value is (mode == 'heating')


def test_a_free_mode_is_refused():
    m = controlled_ramp.build(relay=True)
    for v in m.component_data_objects(pyo.Var):
        if v.fixed and 'nu' in v.name:
            v.unfix()
    with pytest.raises(FesdError, match="free in this model"):
        MovingModelInterface(m).load_modes(['heating'])
