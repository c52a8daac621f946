"""Values that move on with the horizon: on physical time, with all that belongs to elements, and only where stages are alike."""

import bouncing_ball
import numpy as np
import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd import FesdError, MovingModelInterface
from tests.problems import controlled_ramp
from tests.problems.controlled_ramp import INTERVAL


def table(m):
    return pyomo_fesd.trajectory(m, m.t).drop(columns=['label', 'element'])


def inside(frame, begin, end):
    """Rows strictly between two times: at stage boundaries values of two stages meet."""
    return frame[(frame.index > begin + 1e-9) & (frame.index < end - 1e-9)]


@pytest.mark.parametrize('scheme', ['LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE'])
@pytest.mark.parametrize('stages', [1, 2])
def test_a_moved_grid_moves_on_physical_time(scheme, stages):
    m = controlled_ramp.build(stages=5, relay=True, scheme=scheme)
    pyomo_fesd.simulate(m, inputs=[m.u])
    (crossing,) = [s.time for s in pyomo_fesd.switches(m) if 'kink' in str(s)]
    before, dt = table(m), stages * INTERVAL
    lengths = pyomo_fesd.element_lengths(m, m.t)['length'].to_numpy()
    MovingModelInterface(m).shift_values_by_time(dt)
    after, end = table(m), 5 * INTERVAL - dt
    old, new = inside(before, dt, 5 * INTERVAL), inside(after, 0.0, end)
    assert new.index.to_numpy() == pytest.approx(old.index.to_numpy() - dt, abs=1e-12)
    np.testing.assert_array_equal(new.to_numpy(), old.to_numpy())
    assert pyomo_fesd.element_lengths(m, m.t)['length'].to_numpy()[: -3 * stages] == pytest.approx(lengths[3 * stages :])
    # crossed in the second stage, so it is still ahead after one
    if crossing > dt:
        assert [s.time for s in pyomo_fesd.switches(m) if 'kink' in str(s)] == pytest.approx([crossing - dt])
    assert m.x[0].value == pytest.approx(before['x'][np.isclose(before.index, dt)].iloc[0])


def test_the_end_goes_on_as_it_was():
    m = controlled_ramp.build(stages=4)
    pyomo_fesd.simulate(m, inputs=[m.u])
    end = m.x[m.t.last()].value
    MovingModelInterface(m).shift_values_by_time()
    last = table(m).loc[3 * INTERVAL + 1e-9 :]
    assert (last['x'] == end).all()
    assert pyomo_fesd.element_lengths(m, m.t)['length'].to_numpy()[-3:] == pytest.approx(INTERVAL / 3, abs=2e-6)


def test_a_shifted_solution_of_a_stationary_problem_is_a_solution():
    m = controlled_ramp.control_problem()
    m.x[0].fix(0.5)
    controller = pyomo_fesd.Controller(m, [m.u], [m.goal])
    first = controller.step()
    second = controller.step({'x[*]': 0.5})
    assert first.certified and second.origin == 'branch' and second.objective == pytest.approx(first.objective, rel=1e-7)


def test_jumps_move_on():
    m = bouncing_ball.build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=24, ncp=2)
    with pytest.raises(FesdError, match='no control stage begins'):
        MovingModelInterface(m).shift_values_by_time(1.0)


def test_stages_that_differ_are_refused_and_nothing_is_moved():
    m = controlled_ramp.build(lengths=[0, 0.5, 1.0, 2.0])
    pyomo_fesd.simulate(m, inputs=[m.u])
    before = table(m)
    with pytest.raises(FesdError, match=r'element 7.*is not element 4.*moved by 0\.5'):
        MovingModelInterface(m).shift_values_by_time()
    assert table(m).equals(before)
