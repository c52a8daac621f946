"""The optimal control problems are certified at the defaults, at the known minimum; and the replay of controls."""

import numpy as np
import pytest
from benchmarks.ocp import replay, run, scaling
from benchmarks.ocp.summary import PROBLEMS

#: A coarse grid's error of the objective, relative.
ERROR = {'sliding': 1e-4, 'motor': 5e-3, 'cartpole': 3e-3, 'tank': 1e-9, 'gearbox': 0.02, 'ellipse': 1e-6}


@pytest.mark.parametrize('problem', PROBLEMS)
def test_each_problem_is_certified_at_its_known_minimum(problem):
    p = run.module(problem)
    found, _ = run.with_pyomo_fesd(p, None, 60)
    assert found['certified']
    assert found['objective'] == pytest.approx(p.REFERENCE, rel=ERROR[problem])


def test_ten_equal_stages_of_the_car_are_not_faster_than_free_ones():
    p = run.module('gearbox')
    found, _ = run.with_pyomo_fesd(p, None, 60)
    assert p.REFERENCE <= found['objective'] <= 1.0096 * p.REFERENCE


def test_the_replay_confirms_where_the_sliding_modes_end():
    p = run.module('sliding')
    _, used = run.with_pyomo_fesd(p, None, 60)
    assert run.replayed(p, used) < 1e-4


def relay(x, u):
    """x' = u - sgn x, at the cost x^2."""
    return np.array([u[0]]), np.array([[-1.0]]), x, np.eye(1), x[0] ** 2


def test_a_relay_arrives_slides_and_is_driven_out():
    end, cost = replay.replay(relay, [0.5], [0.0, 3.0], [1.0, 0.5])
    assert end[0] == pytest.approx(1.0)
    assert cost == pytest.approx(0.5**3 / 3 + 1 / 6)


def test_a_relay_crosses_its_surface():
    end, _ = replay.replay(relay, [0.2], [-3.0], [0.15])
    assert end[0] == pytest.approx(-0.2)


def test_a_relay_leaves_a_slide_on_the_right_side():
    # the clock x2 drives s = x2 - 2 past -1 at x2 = 1, and x1 then falls with 2 (x2 - 1)
    def plant(x, u):
        return np.array([1 - x[1], 1.0]), np.array([[-1.0], [0.0]]), x[:1], np.eye(2)[:1], 0.0

    end, _ = replay.replay(plant, [0.0, 0.0], [0.0], [3.0])
    assert end[0] == pytest.approx(-0.5)


def test_random_controls_are_the_same_for_both_methods():
    first, again = (run.random_controls('motor', 3) for _ in range(2))
    assert np.array_equal(first, again) and first.shape == (30, 1) and np.abs(first).max() <= 5


@pytest.mark.parametrize('problem', ['sliding', 'tank'])
def test_the_twin_in_nosnoc_states_the_same_problem(problem):
    pytest.importorskip('nosnoc', reason='the peer is no dependency: pip install nosnoc==0.2.0')
    p = run.module(problem)
    found, _ = run.with_nosnoc(p, None, 60)
    assert found['objective'] == pytest.approx(p.REFERENCE, rel=1e-3)


def test_ipopt_would_scale_the_rows_of_the_motor_and_the_objective_of_the_cart():
    of_objective, of_rows = scaling.gradients(scaling.started('motor', 0))
    assert of_objective <= scaling.LARGEST < of_rows.max()
    of_objective, of_rows = scaling.gradients(scaling.started('cartpole', 0))
    assert of_rows.max() <= scaling.LARGEST < of_objective
    assert scaling.changes(of_objective)['objective']['obj_scaling_factor'] == scaling.LARGEST / of_objective
