"""Passes through the elements: what is left in the model where a later pass finds other switches than the first one."""

import pyomo.environ as pyo
import pytest
import signum

import pyomo_fesd
from pyomo_fesd.simulation.passes import Simulation
from pyomo_fesd.simulation.step_sizes import EqualSteps
from tests.models import dcs, finite_elements


def test_later_passes_that_do_not_fit_leave_the_values_of_the_first(monkeypatch):
    run, plans = Simulation._pass, []

    def every_later_one_uses_up_the_time(self, plan):
        plans.append(plan)
        return run(self, plan if len(plans) == 1 else EqualSteps(dict.fromkeys(range(1, 5), 10.0), set()))

    monkeypatch.setattr(Simulation, '_pass', every_later_one_uses_up_the_time)
    m = finite_elements(dcs(signum.build()), nfe=4)
    pyomo_fesd.simulate(m)
    assert len(plans) > 1
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([2 / 3])
    for c in m.component_data_objects(pyo.Constraint, active=True):
        assert max(-c.lslack(), -c.uslack(), 0) < 1e-6, c.name
