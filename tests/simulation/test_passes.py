"""Passes through the elements: which elements are solved again, and what is left where a later pass finds other switches."""

from collections import Counter

import bouncing_ball
import pyomo.environ as pyo
import pytest
import signum
import thermostat

import pyomo_fesd
from pyomo_fesd.simulation.element_solver import ElementSolver
from pyomo_fesd.simulation.passes import Simulation
from pyomo_fesd.simulation.step_sizes import EqualSteps
from tests.models import dcs, finite_elements


def test_later_passes_that_do_not_fit_leave_the_values_of_the_first(monkeypatch):
    run, plans = Simulation._pass, []

    def every_later_one_uses_up_the_time(self, plan):
        plans.append(plan)
        return run(self, EqualSteps(dict.fromkeys(range(1, 5), 10.0), set()))

    monkeypatch.setattr(Simulation, '_pass', every_later_one_uses_up_the_time)
    m = finite_elements(dcs(signum.build()), nfe=4)
    pyomo_fesd.simulate(m)
    assert plans
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([2 / 3])
    for c in m.component_data_objects(pyo.Constraint, active=True):
        assert max(-c.lslack(), -c.uslack(), 0) < 1e-6, c.name


def in_stages(m, nfe, *boundaries):
    """The transformed model whose control stages end at the ``boundaries``."""
    stages = len(boundaries) + 1
    return finite_elements(m, nfe=[nfe] * stages, ncp=3, fixed_points=list(boundaries))


def heated_room():
    m = thermostat.build()
    return dcs(m, hysteresis=[m.relay])


MODELS = {
    'modes': (lambda: in_stages(dcs(signum.build()), 2, 0.4, 0.8), [2 / 3]),
    'hysteresis': (lambda: in_stages(heated_room(), 3, 0.6, 1.2, 1.8), thermostat.switching_times()),
    'jumps': (lambda: in_stages(bouncing_ball.build(), 3, 1.0, 2.0), bouncing_ball.impacts()),
}


@pytest.mark.parametrize('name', MODELS)
def test_a_pass_goes_on_from_the_control_stage_whose_elements_did_not_fit(name, monkeypatch):
    build, exact = MODELS[name]
    m, solve, solved, equalise = build(), ElementSolver.solve, Counter(), Simulation._equalise
    times = []

    def counted(self, element, *args):
        solved[element.n] += 1
        return solve(self, element, *args)

    def before_the_next_pass(self):
        times.append(dict(solved))
        return equalise(self)

    monkeypatch.setattr(ElementSolver, 'solve', counted)
    monkeypatch.setattr(Simulation, '_equalise', before_the_next_pass)
    pyomo_fesd.simulate(m)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx(exact, abs=1e-6)
    assert set(times[0].values()) == {1, 2}, "elements of a stage that does not fit are solved twice, all others once"
