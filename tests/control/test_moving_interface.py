"""The interface for data of a moving model: Pyomo's, with intervals of whole control stages only."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.contrib.mpc import IntervalData

from pyomo_fesd import FesdError, MovingModelInterface
from tests.problems import controlled_ramp


def test_data_are_loaded_as_in_pyomo():
    m = controlled_ramp.build()
    interface = MovingModelInterface(m)
    interface.load_data({m.x: 0.25}, time_points=[0])
    assert m.x[0].value == 0.25 and m.x[m.t.last()].value == -1
    interface.load_data(IntervalData({m.u: [0.1, 0.2]}, [(0.0, 0.5), (0.5, 1.0)]))
    assert (m.u[0.5].value, m.u[1].value, m.u[1.5].value) == (0.1, 0.2, 1.0)
    assert interface.get_data_at_time(0.0).get_data_from_key(m.x) == 0.25 and interface.stage == 0.5


def test_an_interval_that_ends_where_elements_move_is_refused():
    m = controlled_ramp.build()
    with pytest.raises(FesdError, match=r'an interval ends at 0\.7, inside of a control stage'):
        MovingModelInterface(m).load_data(IntervalData({m.u: [0.1]}, [(0.0, 0.7)]))
    assert m.u[0.5].value == 1.0


def test_a_model_without_a_moving_grid_is_refused():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=3)
    with pytest.raises(FesdError, match='elements are not movable'):
        MovingModelInterface(m)
