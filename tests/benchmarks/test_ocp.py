"""The optimal control problems are certified at the defaults, at the known minimum; and the replay of controls."""

import numpy as np
import pandas as pd
import pytest
from benchmarks.ocp import automaton, cartpole, ellipse, gearbox, replay, run, scaling, tank
from benchmarks.ocp.summary import PROBLEMS, summary
from scipy.integrate import solve_ivp

#: A coarse grid's error of the objective, relative.
ERROR = {'sliding': 1e-4, 'motor': 5e-3, 'cartpole': 3e-3, 'tank': 1e-9, 'gearbox': 0.02, 'ellipse': 1e-6}


#: Problems whose controls cost in the replay what the solution says, to this, relative, and reach the goal to this distance; the
#: upright pole is unstable, so that the error of the grid grows.
REPLAYED = {'sliding': (1e-6, 1e-5), 'motor': (1e-9, 1e-2), 'tank': (1e-8, None), 'gearbox': (1e-9, 1e-6), 'ellipse': (1e-9, 1e-5)}


@pytest.mark.parametrize('problem', PROBLEMS)
def test_each_problem_is_certified_at_its_known_minimum_and_the_replay_confirms_it(problem):
    p = run.module(problem)
    found, used = run.with_pyomo_fesd(p, None, 60)
    assert found['certified']
    assert found['objective'] == pytest.approx(p.REFERENCE, rel=ERROR[problem])
    assert found['cpu'] > 0
    if problem in REPLAYED:
        cost, distance = REPLAYED[problem]
        row = run.replayed(p, *used)
        assert row['replayed'] == pytest.approx(found['objective'], rel=cost)
        assert row['missed'] == '' if distance is None else row['missed'] <= distance


def test_ten_equal_stages_of_the_car_are_not_faster_than_free_ones():
    p = run.module('gearbox')
    found, _ = run.with_pyomo_fesd(p, None, 60)
    assert p.REFERENCE <= found['objective'] <= 1.0096 * p.REFERENCE


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


def test_full_throttle_changes_gear_after_three_seconds():
    # 5 m/s^2 to 15 m/s in A, then 15 m/s^2 in B
    end, cost = gearbox.replay_controls([5.0], [3.6])
    assert end == pytest.approx([22.5 + 15 * 0.6 + 7.5 * 0.6**2, 24.0], abs=1e-9)
    assert cost == pytest.approx(3.6)


def test_the_gearbox_keeps_its_gear_between_the_thresholds():
    # gear B to 16 m/s and back to 11 m/s; A reaches 11 m/s and stays A
    end, _ = gearbox.replay_controls([5.0, -5.0], [3 + 1 / 15, 1 / 3])
    assert end[1] == pytest.approx(11.0)
    end, _ = gearbox.replay_controls([5.0, 5.0], [2.2, 0.2])
    assert end[1] == pytest.approx(12.0)


def test_the_best_controls_of_the_car_reach_the_goal_in_152_15_seconds():
    # from 25 m/s the car coasts until full brake takes it to rest: 1 s to 10 m/s in B, 2 s more in A
    end, cost = gearbox.replay_controls([5.0, 0.0, -5.0], [11 / 3, 52 / 15, 3.0])
    assert end == pytest.approx([150, 0], abs=1e-8)
    assert cost == pytest.approx(gearbox.REFERENCE)
    assert gearbox.missed(end) < 1e-8


def test_a_threshold_at_the_end_of_a_stage_is_passed_in_the_next_one():
    end, _ = gearbox.replay_controls([5.0, 5.0], [3.0, 0.2])
    assert end[1] == pytest.approx(18.0)
    end, _ = gearbox.replay_controls([5.0, -5.0], [3.0 - 1e-12, 0.2])
    assert end[1] == pytest.approx(14.0)


def test_a_point_that_is_pressed_on_the_ellipse_stays_on_it():
    end, cost = ellipse.replay_controls([[0.0, 0.0]], [4.0])
    assert ellipse.outside(end) == pytest.approx(0, abs=1e-9)
    assert cost == 0


def test_a_point_slides_along_the_ellipse_as_a_rotation_of_its_angle():
    # on (2 cos a, 4 sin a) the projection leaves the speed along the tangent: a' = f . tangent/|tangent|^2
    angle = 1.2
    start = np.array([2 * np.cos(angle), 4 * np.sin(angle)])
    u, length = np.array([0.3, -0.2]), 1.5

    def rate(t, a):
        tangent = np.array([-2 * np.sin(a[0]), 4 * np.cos(a[0])])
        return [ellipse.MODES['free'].field((2 * np.cos(a[0]), 4 * np.sin(a[0])), u) @ tangent / (tangent @ tangent)]

    a = solve_ivp(rate, (0, length), [angle], rtol=1e-11, atol=1e-13).y[0, -1]
    end, cost = automaton.replay(ellipse.MODES, lambda x, u: 10 * (u @ u), start, 'free', [u], [length])
    assert end == pytest.approx([2 * np.cos(a), 4 * np.sin(a)], abs=1e-8)
    assert cost == pytest.approx(10 * 0.13 * length)


#: A floor x2 >= 0 below a point that moves with its control.
FLOOR = {
    'free': automaton.Mode(lambda x, u: u, ((lambda x, u: x[1], 'floor'),)),
    'floor': automaton.Mode(lambda x, u: np.array([u[0], 0.0]), ((lambda x, u: -u[1], 'free'),)),
}


def test_a_point_lands_on_a_floor_slides_and_is_lifted_by_the_next_control():
    # it lands after 0.5 s, and x2^2 costs 1/24 until then and 1/3 after it is lifted
    controls, lengths = [[1.0, -1.0], [1.0, -2.0], [1.0, 1.0]], [1.0, 1.0, 1.0]
    end, cost = automaton.replay(FLOOR, lambda x, u: x[1] ** 2, [0.0, 0.5], 'free', controls, lengths)
    assert end == pytest.approx([3.0, 1.0])
    assert cost == pytest.approx(1 / 24 + 1 / 3)


def test_modes_without_a_consistent_one_are_reported():
    modes = {
        'up': automaton.Mode(lambda x, u: (1.0,), ((lambda x, u: -x[0], 'down'),)),
        'down': automaton.Mode(lambda x, u: (-1.0,), ((lambda x, u: x[0], 'up'),)),
    }
    with pytest.raises(RuntimeError, match="no mode is consistent"):
        automaton.replay(modes, lambda x, u: 0.0, [0.0], 'up', [0.0], [2.0])


def test_the_level_of_the_tank_slides_on_the_outlet_at_the_cost_of_250():
    end, cost = tank.replay_controls([0.1] * 5, [5.0] * 5)
    assert cost == pytest.approx(250, abs=1e-8)
    assert end[1] == pytest.approx(250, abs=1e-8)


def test_a_closed_valve_fills_the_tank():
    # 100 (0 - 0.1)^2 = 1 a second, and 2.5 mol a second
    end, cost = tank.replay_controls([0.0], [4.0])
    assert end == pytest.approx([tank.START[0] + 0.4, 270.0])
    assert cost == pytest.approx(4.0 + 270.0)


def test_dry_friction_holds_the_cart_at_rest():
    end, cost = cartpole.replay_controls([1.0], [2.0])
    assert end == pytest.approx(cartpole.START)
    assert cost == pytest.approx(2 * (cartpole.distance(cartpole.RUNNING, end) + 1) + cartpole.distance(cartpole.FINAL, end))


def test_the_pole_swings_at_the_rate_of_its_energy():
    # force times way, less friction, is the energy gained
    end, _ = cartpole.replay_controls([10.0], [0.4])
    x, theta, v, w = end
    way, moving = x - cartpole.START[0], cartpole.M2 * cartpole.LENGTH
    kinetic = (cartpole.M1 + cartpole.M2) * v**2 / 2 + moving * v * w * np.cos(theta) + moving * cartpole.LENGTH * w**2 / 2
    assert kinetic + moving * cartpole.G * (1 - np.cos(theta)) == pytest.approx((10 - cartpole.F) * way, rel=1e-8)


def test_a_replay_that_fails_leaves_a_row(monkeypatch):
    def fails(controls, lengths):
        raise RuntimeError("no mode is consistent")

    monkeypatch.setattr(gearbox, 'replay_controls', fails)
    assert run.replayed(gearbox, [], []) == {'status of replay': 'no mode is consistent'}


def test_the_summary_has_medians_over_the_starts():
    columns = dict.fromkeys(run.COLUMNS, 1.0) | {'problem': 'tank', 'status': 'optimal'}
    ours = [columns | {'method': 'pyomo_fesd', 'certified': True, 'cpu': cpu, 'start': k} for k, cpu in enumerate((1.0, 2.0, 9.0))]
    theirs = [columns | {'method': 'nosnoc', 'status': 'SUCCESS', 'certified': None, 'cpu': 4.0, 'off': 0.0}]
    table = summary(pd.DataFrame(ours + theirs))
    mine, peer = table.loc[('tank', 'pyomo_fesd')], table.loc[('tank', 'nosnoc')]
    assert (mine['starts'], mine['certified'], mine['cpu'], mine['cpu / nosnoc']) == (3, 3, 2, 0.5)
    assert (mine['at the reference'], peer['at the reference'], peer['solved'], peer['cpu / nosnoc']) == (0, 1, 1, 1)
    assert pd.isna(peer['certified'])


def test_random_controls_are_the_same_for_both_methods():
    first, again = (run.random_controls('motor', 3) for _ in range(2))
    assert np.array_equal(first, again) and first.shape == (30, 1) and np.abs(first).max() <= 5


def test_random_controls_of_the_point_stay_in_its_disc():
    controls = np.array([run.random_controls('ellipse', k) for k in range(1, 11)])
    assert controls.shape == (10, 20, 2) and 0.9 < np.linalg.norm(controls, axis=-1).max() <= 1


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


def test_the_controls_of_the_car_in_nosnoc_are_replayed_in_physical_time():
    pytest.importorskip('nosnoc', reason='the peer is no dependency: pip install nosnoc==0.2.0')
    found, (controls, lengths) = run.with_nosnoc(gearbox, None, 60)
    assert controls.shape == (gearbox.STAGES, 1)
    assert sum(lengths) == pytest.approx(found['objective'])
    assert run.replayed(gearbox, controls, lengths)['missed'] > 0.1
