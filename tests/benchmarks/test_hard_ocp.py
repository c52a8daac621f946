"""The replay of hard optimal control problems against exact answers, and their models."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pyomo.environ as pyo
import pytest
from benchmarks.hard_ocp import ball, carts, cases, discs, hopper, summary
from benchmarks.hard_ocp.events import CROSSED, first_crossing
from benchmarks.hard_ocp.replay import Plant, replay
from scipy.optimize import brentq

CASES = [ball, carts, discs, hopper]
FORMS = [(p, form) for p in CASES for form in p.FORMS]


def point(gap, slope, friction=0.0, restitution=0.0, pull=(0.0, -10.0), rate=lambda q, v, u, stage: 0.0):
    """A point of mass 2 in the plane under a force, above a line with the normal ``slope``; u is a force along the first axis."""
    n = np.array(slope) / np.hypot(*slope)
    rows, along = np.array([n]), np.array([[n[1], -n[0]]])
    return Plant(
        mass=np.array([2.0, 2.0]),
        force=lambda q, v, u: 2 * np.array(pull) + np.array([u[0], 0.0]),
        gap=gap,
        normal=lambda q: rows + 0 * q[0],
        tangent=lambda q: along + 0 * q[0],
        rate=rate,
        friction=friction,
        restitution=restitution,
    )


FLOOR = point(lambda q: q[1:], (0.0, 1.0))


def test_a_ball_bounces_at_its_exact_times():
    end = replay(replace(FLOOR, restitution=0.8), ((0.0, 0.8), (1.0, 0.0)), [[0.0], [0.0]], [0.7, 0.9])
    first = np.sqrt(2 * 0.8 / 10)
    times = [first, first + 1.6 * first, first + 1.6 * first * 1.8]
    assert [time for time, _, _ in end.impacts] == pytest.approx(times, abs=1e-9)
    left = 1.6 - times[2]
    rebound = 0.8**3 * 10 * first
    assert (*end.q, *end.v) == pytest.approx([1.6, rebound * left - 5 * left**2, 1.0, rebound - 10 * left], abs=1e-8)


def test_a_ball_stays_after_an_inelastic_impact():
    end = replay(FLOOR, ((0.0, 0.8), (1.0, 0.0)), [[0.0]], [1.5])
    assert len(end.impacts) == 1 and (*end.q, *end.v) == pytest.approx([1.5, 0.0, 1.0, 0.0], abs=1e-9)


@pytest.mark.parametrize('above, impacts', [(1e-7, 1), (-1e-7, 0)])
def test_a_short_visit_is_found_and_a_near_miss_is_not(above, impacts):
    ceiling = replace(point(lambda q: 1 - q[1:], (0.0, -1.0)), restitution=1.0)
    end = replay(ceiling, ((0.0, 0.0), (0.0, np.sqrt(20 * (1 + above)))), [[0.0]], [0.8])
    assert len(end.impacts) == impacts


@pytest.mark.parametrize('start, slope, crosses', [(-1.1, 1.0, False), (-1.1, -1.0, True), (-3.0, 0.1, True), (0.0, -1.0, True)])
def test_a_function_that_begins_below_by_round_off_has_to_fall_further(start, slope, crosses):
    grid = np.linspace(0.0, 10 * CROSSED, 5)
    found = first_crossing((lambda t: start * CROSSED + slope * t, {}), grid)
    assert (found is not None) == crosses


def test_a_block_slides_until_it_stops_and_sticks():
    # 2 m/s against friction 0.25 g: stops after 0.8 s and 0.8 m; then 4 N < 5 N hold it, and 9 N move it with 2 m/s2
    end = replay(replace(FLOOR, friction=0.25), ((0.0, 0.0), (2.0, 0.0)), [[0.0], [4.0], [9.0]], [1.0, 1.0, 0.5])
    assert (end.slipped, end.q[0], end.v[0]) == pytest.approx((0.8 + 0.25, 0.8 + 0.25, 1.0), abs=1e-7)


def test_friction_acts_at_an_impact():
    # 4 m/s down: the impulse of friction 0.25 takes 1 m/s of 3 m/s, and all of 0.5 m/s; then the floor brakes with 2.5 m/s2
    floor = replace(FLOOR, friction=0.25)
    for before, after in ((3.0, 2.0), (0.5, 0.0)):
        end = replay(floor, ((0.0, 0.8), (before, 0.0)), [[0.0]], [0.4 + 1e-6])
        assert end.v[0] == pytest.approx(after, abs=1e-5)


def test_a_block_on_an_incline_sticks_below_the_angle_of_friction_and_slides_above():
    for slope, friction, end in ((0.2, 0.25, 0.0), (0.3, 0.25, 10 * (0.3 - 0.25) / np.hypot(0.3, 1.0))):
        incline = point(lambda q, s=slope: (q[1:] + s * q[:1]) / np.hypot(s, 1.0), (slope, 1.0), friction)
        found = replay(incline, ((0.0, 0.0), (0.0, 0.0)), [[0.0]], [1.0])
        assert np.hypot(*found.v) == pytest.approx(end, abs=1e-8)


def test_the_middle_cart_pushes_the_right_one():
    # alone: q = 5 (t - (1 - exp(-2t))/2); together half the drive
    touch = brentq(lambda t: 5 * (t - (1 - np.exp(-2 * t)) / 2) - 1, 0.1, 2)
    v = 5 * (1 - np.exp(-2 * touch)) / 2
    left = 2 - touch
    speed = 2.5 + (v - 2.5) * np.exp(-2 * left)
    way = 2.5 * left + (v - 2.5) * (1 - np.exp(-2 * left)) / 2
    end = replay(carts.PLANT, carts.AT_START, [[10.0]] * 8, [0.25] * 8)
    assert [(time, which) for time, which, _ in end.impacts] == [(pytest.approx(touch, abs=1e-9), (1,))]
    assert (*end.q[1:], *end.v[1:]) == pytest.approx([1 + way, 3 + way, speed, speed], abs=1e-8)


def test_a_row_of_carts_takes_a_push_together():
    plant = replace(carts.PLANT, force=lambda q, v, u: np.array([u[0], 0.0, 0.0]))
    end = replay(plant, ((-2.5, 0.0, 2.0), (3.0, 0.0, 0.0)), [[0.0], [6.0], [-6.0]], [0.5, 0.5, 0.5])
    assert end.impacts[0][0] == pytest.approx(0.5 / 3, abs=1e-9)
    assert end.v == pytest.approx([2 - 3, 2, 2], abs=1e-8)


def test_energy_is_balanced_over_an_impact_of_the_discs():
    def power(q, v, u, stage):
        return discs.PLANT.force(q, v, u) @ v

    plant = replace(discs.PLANT, rate=power)
    end = replay(plant, discs.AT_START, [[10.0, 0.3]] * 20, [0.1] * 20)
    assert len(end.impacts) == 1
    (time, _, (closing,)) = end.impacts[0]
    at = end.positions[int(np.argmin(np.abs(np.array(end.times) - time)))]
    n = plant.normal(at)[0]
    lost = closing**2 / 2 / (n @ (n / plant.mass))
    assert plant.mass @ end.v**2 / 2 == pytest.approx(end.cost - lost, abs=1e-7)


def random_controls(p, seed):
    return np.random.default_rng(seed).uniform(*p.U_RANGE, (p.STAGES, p.CONTROLS)) / 2


@pytest.mark.parametrize('p', CASES)
def test_coarse_and_fine_replays_agree(p):
    ends = [
        replay(p.PLANT, p.AT_START, random_controls(p, 1)[:8], [p.HORIZON / p.STAGES] * 8, *how)
        for how in ((1e-7, 25), (1e-11, 90))
    ]
    coarse, fine = (np.array([*end.q, *end.v, end.cost]) for end in ends)
    assert coarse == pytest.approx(fine, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize('p', CASES)
def test_normals_are_gradients_of_the_gaps(p):
    q = np.array(p.START) + 0.1 * np.random.default_rng(0).uniform(size=len(p.START))
    step = 1e-30j * np.eye(len(q))
    assert np.imag([p.PLANT.gap(q + e) for e in step]).T * 1e30 == pytest.approx(p.PLANT.normal(q))


def test_the_slip_of_the_hopper_is_the_velocity_of_its_foot():
    q, v = np.array([0.2, 0.4, 0.3, 0.45]), np.array([1.0, -0.5, 2.0, 0.7])
    foot = lambda q: q[0] + q[3] * np.sin(q[2])  # noqa: E731
    assert np.imag(foot(q + 1e-30j * v)) * 1e30 == pytest.approx(hopper.PLANT.tangent(q)[0] @ v)


def shortened(p, monkeypatch):
    """The problem with three control stages."""
    monkeypatch.setattr(p, 'STAGES', 3)
    if p is hopper:
        monkeypatch.setattr(p, 'WANTED', p.reference()[1:])
    return p


def random_state(p):
    """q, v, u."""
    n, drawn = len(p.START), np.random.default_rng(3)
    return drawn.uniform(0.2, 0.9, n), drawn.uniform(-1, 1, n), drawn.uniform(-1, 1, p.CONTROLS)


@pytest.mark.parametrize('p, form', FORMS)
def test_each_model_takes_guessed_controls_and_is_that_of_the_replay(p, form, monkeypatch):
    p = shortened(p, monkeypatch)
    m = p.build(form)
    cases.initialise(p, m, random_controls(p, 2))
    assert p.controls(m) == pytest.approx(random_controls(p, 2))

    q, v, u = random_state(p)
    cases.initialise(p, m, np.tile(u, (3, 1)))
    for t in m.t:
        for i in m.i:
            for var, number in ((m.q, q), (m.v, v), (m.dq, v), (m.dv, p.PLANT.force(q, v, u) / p.PLANT.mass)):
                var[i, t].set_value(float(number[i - 1]), skip_validation=True)
    own = [c for name in ('way', 'momentum', 'along', 'up') if (c := m.component(name)) is not None]
    assert max(abs(pyo.value(row.body) - pyo.value(row.upper)) for c in own for row in c.values()) < 1e-9
    paid = sum(p.PLANT.rate(q, v, u, stage) for stage in range(3)) * p.HORIZON / 3
    assert pyo.value(m.cost) == pytest.approx(paid + p.final_cost(q, v))


@pytest.mark.parametrize('p', CASES)
def test_the_twin_in_nosnoc_states_the_same_problem(p):
    pytest.importorskip('nosnoc', reason='the peer is no dependency: pip install nosnoc==0.2.0')
    import casadi as ca

    q, v, u = random_state(p)
    twin = p.twin()
    given, speed = twin.model, 2.0
    # in flight: above all surfaces
    flight = given.get('z', given['alpha'][0])
    other = [given['p_time_var']] if 'p_time_var' in given else []
    field = ca.Function(
        'f', [given['x'], given['u'], flight, *other], [given['f_x'][0], twin.costs['f_q'], twin.costs['f_terminal']]
    )
    values = ([*q, *v, 0.0], [*u, speed], [1, *[0] * (flight.numel() - 1)], *(p.WANTED[4] for _ in other))
    rates, paid, final = field(*values)
    expected = speed * np.array([*v, *(p.PLANT.force(q, v, u) / p.PLANT.mass), 1])
    assert rates.full().ravel() == pytest.approx(expected)
    assert float(paid) == pytest.approx(speed * p.PLANT.rate(q, v, u, 4))
    assert float(final) == pytest.approx(p.final_cost(q, v))


def test_points_on_the_way_are_solutions_of_branches_and_each_better_than_those_before():
    steps = [('relaxation', 1.0, 0.0), ('branch', 9.0, 1e-3), ('branch', 8.0, 0.0), ('branch', 8.5, 0.0), ('branch', 7.0, 1e-9)]
    steps = [SimpleNamespace(kind=kind, f=f, violation=off, complementarity=0.0, seconds=2.0) for kind, f, off in steps]
    assert cases.better_points(steps, 1.0, 21.0) == '13:8 21:7'


def test_a_run_is_as_good_when_it_has_a_point_of_at_most_the_true_cost_of_the_peer():
    ours = {'method': 'contact', 'replayed': 5.0, 'cpu': 30.0}
    better = {0: '2:90 6:40 20:5', 1: '2:90', 2: np.nan}
    rows = [{'problem': 'ball', 'seed': k, 'better': text} | ours for k, text in better.items()]
    rows += [{'problem': 'ball', 'seed': k, 'method': 'nosnoc', 'replayed': 40.0, 'cpu': 12.0} for k in better]
    found = summary.seconds_until_as_good(pd.DataFrame(rows))
    assert found.to_dict() == {('ball', 'contact', 0): 0.5, ('ball', 'contact', 1): np.inf}
