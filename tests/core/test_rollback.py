"""An interruption in the middle of the work leaves the model as it was."""

import bouncing_ball
import pyomo.environ as pyo
import pytest
import thermostat

import pyomo_fesd
from pyomo_fesd.finite_elements import transformation
from tests.models import collocate, dcs
from tests.problems.running import move, seen


def heated(grid):
    m = thermostat.room(1)
    if grid:
        collocate(m, 6, 2)
    return dcs(thermostat.add_heater(m), hysteresis=[m]), thermostat.switching_times(1)


def bouncing(grid):
    m = bouncing_ball.build(1.0, 1)
    if grid:
        collocate(m, 6, 2)
    return m, bouncing_ball.impacts(1.0, 1)


@pytest.mark.parametrize('grid', [False, True], ids=['no grid yet', 'on a grid'])
@pytest.mark.parametrize('build', [heated, bouncing])
def test_interrupted_after_everything_was_written(build, grid, monkeypatch):
    def interrupt(*args):
        raise KeyboardInterrupt

    m, switches = build(grid)
    before = seen(m)
    with monkeypatch.context() as patch:
        patch.setattr(transformation, 'add_neighbour_branches', interrupt)
        with pytest.raises(KeyboardInterrupt):
            move(m, 6, 2)
    assert seen(m) == before
    assert all(s.active for s in m.component_data_objects(pyo.Suffix))
    move(m, 6, 2)
    pyomo_fesd.simulate(m)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(switches, abs=1e-5)
