"""The study of estimation: from bad starts to the noise floor, no false certificate where a switch is at the end of the horizon."""

import numpy as np
import pyomo.environ as pyo
import pytest
from benchmarks.estimation.run import BOUNDS, TRUTH, build, least_of_closed_form, measurements

import pyomo_fesd
from pyomo_fesd.core import homotopy_hints, moving_grids


def first_start():
    """The first start of the study."""
    random = np.random.default_rng(7)
    return {name: random.uniform(*bounds) for name, bounds in BOUNDS.items()}


def test_least_squares_on_the_closed_form_without_noise_ends_at_the_truth():
    misfit, estimates = least_of_closed_form(list(measurements(0.0)))
    assert misfit < 1e-20 and estimates == pytest.approx(TRUTH, abs=1e-8)


def test_a_far_start_ends_on_even_elements_at_the_noise_floor(caplog):
    data = list(measurements(0.01))
    m = build(data, first_start(), 6)
    assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B'
    least, estimates = least_of_closed_form(data)
    assert pyo.value(m.misfit) == pytest.approx(least, rel=0.05)
    assert [m.component(name).value for name in TRUTH] == pytest.approx(list(estimates.values()), abs=4e-3)
    assert not [record for record in caplog.records if 'times as long' in record.message]


def test_a_switch_at_the_end_of_the_horizon_is_not_certified():
    m = build(list(measurements(0.0)), first_start(), 4)
    hints = [homotopy_hints(moving_grids(m)[d.t].block) for d in m.run.values()]
    fillings = [list(hint.fillings) for hint in hints]
    for hint in hints:
        hint.fillings.clear()
    solver = pyo.SolverFactory('mpec_hybrid')
    solver.solve(m)
    # branches in which measurements keep their elements have no solution: the level of the outlet is that at the end
    assert m.c.value == pytest.approx(m.run[0].h[3].value, abs=1e-6)
    for hint, before in zip(hints, fillings):
        hint.fillings.extend(before)
    assert not pyomo_fesd.certify(m).certified
    assert solver.solve(m, warm_start=True).solver.stationarity == 'B'
    assert pyo.value(m.misfit) < 1e-4
    assert m.c.value == pytest.approx(TRUTH['c'], abs=2e-3)
