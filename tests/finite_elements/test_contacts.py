"""Rigid contacts: the laws of impact at element boundaries, and whole paths with exact answers."""

from math import cos, sin, sqrt

import numpy as np
import pyomo.environ as pyo
import pytest
from problems.states import over_time

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import moving_grids
from tests.problems import contacts
from tests.problems.contacts import G
from tests.problems.running import SCHEMES, move, seen


def marched(m):
    """Simulated, then solved from there and certified."""
    pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B' and results.solver.nlps <= 4
    return m


def times(m, name):
    return [s.time for s in pyomo_fesd.switches(m) if s.disjunction == name]


def modes(m, name):
    return [(s.before, s.after) for s in pyomo_fesd.switches(m) if s.disjunction == name]


# The laws


def test_three_variables_and_two_pairs_for_each_contact_and_inner_boundary():
    m = move(contacts.ball(0), 5, 2)
    impacts = moving_grids(m)[m.t].state_jumps.impacts
    assert [len(v) for v in (impacts.impulse, impacts.above, impacts.below, impacts.leaving)] == [4, 5, 5, 0]
    assert len(impacts.impact) == 2 * 4 and len(impacts.balance) == 0
    assert pyomo_fesd.report(m)['pairs'] == 5 + 2 * 4 + 1


def test_restitution_adds_the_velocity_with_which_bodies_part():
    m = move(contacts.ball(0.5), 3, 2)
    impacts = moving_grids(m)[m.t].state_jumps.impacts
    assert set(impacts.leaving) == {('table', 1), ('table', 2)}


def test_a_velocity_after_an_impact_is_an_expression_where_no_mass_couples_it():
    m = move(contacts.ball(0), 3, 2)
    grid, jumps = moving_grids(m)[m.t].grid, moving_grids(m)[m.t].state_jumps
    label = grid.elements[0].right
    m.v[label].value, jumps.impacts.impulse['table', 1].value = -3.0, 8.0
    ((v, after),) = jumps.values_after(grid.elements[0]).items()
    assert v is m.v[label] and pyo.value(after) == pytest.approx(-3 + 8 / 2)


def coupled(e=0.5, end=0.5):
    """Two coordinates with the mass matrix [[2, 1], [1, 3]]; the first one falls on a floor."""
    m = over_time(end, x=0.45, y=0.0, v=0.0, w=0.0)
    m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t], restitution=e)
    m.first = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])
    m.second = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.w[t])
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: 2 * m.dv[t] + m.dw[t] == -G * 2 + m.floor[t].normal)
    m.turn = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] + 3 * m.dw[t] == -G)
    return m


def test_masses_couple_velocities():
    m = marched(move(coupled(), 6, 2))
    frame = pyomo_fesd.trajectory(m)
    assert times(m, 'floor') == pytest.approx([0.3], abs=1e-7)
    after = frame[abs(frame.index - 0.3) < 1e-7].iloc[1]
    # v falls with 10, w stays; M (dv, dw) = (impulse, 0)
    assert (after['v'], after['w']) == pytest.approx((1.5, -4.5 / 3), abs=1e-7)


# Whole paths


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_ball_that_does_not_bounce(scheme):
    m = marched(move(contacts.ball(0), 6, 2, scheme=scheme))
    assert times(m, 'table') == pytest.approx([0.4, 0.4], abs=1e-7)
    assert ('open', 'closed') in modes(m, 'table')
    assert (m.q[1].value, m.v[1].value, m.table[1].normal.value) == pytest.approx((0, 0, 2 * G), abs=1e-7)


@pytest.mark.parametrize('e', [0.8, 1.0])
def test_a_ball_that_bounces(e):
    m = marched(move(contacts.ball(e, 2.5), 12, 2))
    first, exact, flight = 0.4, [0.4], 0.8
    while exact[-1] + e * flight < 2.5:
        flight *= e
        exact.append(exact[-1] + flight)
    assert times(m, 'table') == pytest.approx(exact, abs=1e-7)
    since, speed = 2.5 - exact[-1], G * first * e ** len(exact)
    assert m.q[2.5].value == pytest.approx(speed * since - G * since**2 / 2, abs=1e-7)
    assert m.v[2.5].value == pytest.approx(speed - G * since, abs=1e-7)


def test_the_homotopy_finds_impacts_by_itself():
    m = move(contacts.ball(1.0, 1.0), 4, 2)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, simulate_first=False)
    assert results.solver.stationarity == 'B'
    assert times(m, 'table') == pytest.approx([0.4], abs=1e-7)


def test_a_ball_that_lies_on_the_table():
    m = marched(move(contacts.ball(0.5, 1.0, 0.0), 3, 2))
    assert pyomo_fesd.switches(m) == [] and m.q[1].value == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize('nfe', [2, 3])
def test_a_bounce_within_an_element_is_not_swallowed(nfe):
    # with K = 2, contact forces >= 0 could stop the ball between two boundaries on the table
    m = move(contacts.ball(0.5, 0.5, 0.0, 2.0), nfe, 2)
    m.low = pyo.Objective(expr=m.q[0.5])
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    # it starts on the table, and whether it could have rested there first takes an element to spare
    assert results.solver.stationarity == ('B' if nfe > 2 else 'not certified')
    assert m.q[0.5].value == pytest.approx(0.05, abs=1e-7)


def test_a_force_that_lifts():
    m = contacts.ball(0, 2.0, 0.0)
    clock = pyomo_fesd.clock(m, m.t)
    m.del_component(m.momentum)
    m.lifted = pyo.Constraint(m.t, rule=lambda m, t: 2 * m.dv[t] == -2 * G + 16 * clock[t] + m.table[t].normal)
    marched(move(m, 4, 3))
    # 2 dv/dt = 16 (t - 1.25)
    assert times(m, 'table') == pytest.approx([1.25], abs=1e-7)
    assert (m.v[2].value, m.q[2].value) == pytest.approx((4 * 0.75**2, 4 / 3 * 0.75**3), abs=1e-7)


@pytest.mark.parametrize('e, end', [(0, (0.5, 0.5, 0)), (1, (0, 0, 1)), (0.5, (0.25, 0.1875, 0.5625))])
def test_three_blocks_in_a_row(e, end):
    m = marched(move(contacts.blocks(e), 6, 2))
    assert [m.v[i, 3].value for i in m.i] == pytest.approx(end, abs=1e-7)


@pytest.mark.parametrize('e, end', [(0, (1 / 3, 1 / 3, 1 / 3)), (1, (-1 / 3, 2 / 3, 2 / 3))])
def test_a_block_hits_two_that_touch(e, end):
    # Newton's law at both contacts at once
    m = marched(move(contacts.blocks(e, (0, 2, 3), end=2.0), 4, 2))
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(1, abs=1e-7)
    assert [m.v[i, 2].value for i in m.i] == pytest.approx(end, abs=1e-7)


@pytest.mark.parametrize('e', [0, 0.5, 1])
def test_two_discs(e):
    m = marched(move(contacts.discs(e), 6, 2))
    assert times(m, 'hit')[0] == pytest.approx(0.6, abs=1e-7)
    for index, exact in contacts.after_discs(e).items():
        assert m.v[(*index, 2)].value == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize('ncp', [1, 2, 3])
def test_a_curved_contact_keeps_the_order(ncp):
    errors = []
    for nfe in (4, 8):
        m = move(contacts.bowl(), nfe, ncp)
        pyomo_fesd.simulate(m)
        assert pyomo_fesd.switches(m) == []
        errors.append(abs(np.array([v[0.6].value for v in (m.x, m.y, m.v, m.w)]) - contacts.in_bowl()).max())
        assert abs(m.x[0.6].value ** 2 + m.y[0.6].value ** 2 - 1) < 1e-9
    assert np.log2(errors[0] / errors[1]) > (0.6 if ncp == 1 else 2 * ncp - 1.3)


@pytest.mark.parametrize('nfe', [1, 2, 3, 5])
@pytest.mark.parametrize('ncp', [1, 2, 3])
def test_a_mass_at_rest_on_a_disc_is_no_minimum_where_a_force_can_take_it_away(nfe, ncp):
    # gap and contact force are both 0: the weighted equation of the drift has no derivative there
    m = move(contacts.resting(), nfe, ncp)
    pyomo_fesd.simulate(m, inputs=m.u)
    assert (m.q[1, 1].value, m.q[2, 1].value) == pytest.approx((0.6, 0.8))
    found = pyomo_fesd.certify(m)
    assert found.grade.name == 'DESCENT' and found.value < -0.01
    m.away.sense = pyo.maximize
    assert pyomo_fesd.certify(m).grade.name == 'B'


@pytest.mark.parametrize('nfe, ncp', [(5, 2), (3, 2)])
def test_a_solved_contact_is_judged_alike_afterwards(nfe, ncp):
    # 5, 2: at a solution a drift has a slope of 1e-28 in its weighted equation, which shows no size;
    # 3, 2: an element only touches the disc, so that nothing asks for equal lengths, and with free ones the objective descends
    m = move(contacts.resting(), nfe, ncp)
    m.away.sense = pyo.maximize
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert pyomo_fesd.certify(m).certified == (results.solver.stationarity == 'B')


@pytest.mark.parametrize('nfe', [2, 5])
def test_a_force_takes_it_away_as_far_as_it_can(nfe):
    m = move(contacts.resting(), nfe, 2)
    assert pyo.SolverFactory('mpec_hybrid').solve(m).solver.stationarity == 'B'
    assert pyo.value(m.away) == pytest.approx(-1 - (0.6 + 0.8) / 2, abs=1e-6)


@pytest.mark.parametrize('guess', [-1.0, -0.5, 1e-3, 3.0])
def test_no_drift_brings_a_body_to_the_other_side(guess):
    m = move(contacts.resting(guess), 3, 2)
    try:
        pyomo_fesd.simulate(m, inputs=m.u)
    except FesdError as error:
        assert 'another side of its surface' in str(error) and 'initialize' in str(error)
    else:
        assert (m.q[1, 1].value, m.q[2, 1].value) == pytest.approx((0.6, 0.8))


@pytest.mark.parametrize('build, curvature', [(contacts.bowl, 1), (contacts.resting, 2), (lambda: contacts.discs(0), 2)])
def test_a_drift_turns_the_normal_by_half_of_what_the_other_side_takes(build, curvature):
    # of a distance |x_1 - x_2| the second derivatives in both positions are those in one, twice
    m = move(build(), 4, 2)
    turned = moving_grids(m)[m.t].state_jumps.impacts.turned
    assert len(turned) == 8
    for (name, n, r), c in turned.items():
        drift = moving_grids(m)[m.t].state_jumps.impacts.drift[name, n, r]
        drift.set_value(1.0)
        moving_grids(m)[m.t].r[n].set_value(1.0)
        length = moving_grids(m)[m.t].grid.elements[n - 1].length
        assert pyo.value(c.body) == pytest.approx(curvature * length, rel=1e-3) and (c.lower, c.upper) == (-0.5, 0.5)


def test_the_ground_has_no_other_side():
    m = over_time(1.0, q=1.0, v=0.0, a=0.3)
    m.foot = pyomo_fesd.contact(m.t, gap=lambda m, t: m.q[t] - 0.5 * pyo.cos(m.a[t]))
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.turn = pyo.Constraint(m.t, rule=lambda m, t: m.da[t] == 0)
    m.momentum = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -G + m.foot[t].normal)
    impacts = moving_grids(move(m, 3, 2))[m.t].state_jumps.impacts
    assert len(impacts.drift) == 6 and len(impacts.turned) == 0


# Friction


@pytest.mark.parametrize('mu', [0.5, 0.2])
def test_a_block_on_an_incline_stops_and_stays_or_turns(mu):
    m = marched(move(contacts.incline(mu), 5, 2))
    stop = 2 / G / (sin(0.3) + mu * cos(0.3))
    assert times(m, 'plane.friction') == pytest.approx([stop], abs=1e-7)
    back = G * (sin(0.3) - mu * cos(0.3)) * (mu < 0.3)
    assert m.v[1.5].value == pytest.approx(-back * (1.5 - stop), abs=1e-7)
    assert m.s[1.5].value == pytest.approx(stop - back * (1.5 - stop) ** 2 / 2, abs=1e-7)
    assert m.plane[1.5].friction.expr() == pytest.approx(2 * G * (sin(0.3) if mu > 0.3 else mu * cos(0.3)), abs=1e-6)


@pytest.mark.parametrize('mu, height', [(0.5, 0.4), (0.2, 0.4)])
def test_a_block_that_falls_on_an_incline(mu, height):
    m = marched(move(contacts.incline(mu, height=height), 6, 2))
    land = sqrt(2 * height / G / cos(0.3))
    before, press = 2 - G * sin(0.3) * land, G * cos(0.3) * land
    after = before - np.sign(before) * min(abs(before), mu * press)
    frame = pyomo_fesd.trajectory(m)
    row = frame[abs(frame.index - land) < 1e-7].iloc[1]
    assert (row['v'], row['w']) == pytest.approx((after, 0), abs=1e-7)


@pytest.mark.parametrize('height', [0.0, 0.2])
def test_a_disc_that_rolls(height):
    m = marched(move(contacts.disc(height=height), 6, 2))
    # the slip of 3 falls with 3 mu g, at an impact of speed 2 by 3 mu 2
    assert times(m, 'floor.friction') == pytest.approx([0.5], abs=1e-7)
    assert (m.v[2].value, m.turn[2].value) == pytest.approx((2, -2), abs=1e-7)
    assert m.floor[2].friction.expr() == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize('directions', [4, 8])
@pytest.mark.parametrize('height', [0.0, 0.2])
def test_friction_in_space(height, directions):
    # a puck that moves in a direction of the polygon stops on a straight line
    turn = np.arctan2(1.6, 1.2)
    m = move(contacts.puck(height, directions, turn), 6, 2)
    pyomo_fesd.simulate(m)
    # speed 2 falls with 2.5; after a fall of 0.2 s by 0.25 * 2 at once
    way = 2**2 / 2 / 2.5 if not height else 2 * 0.2 + 1.5**2 / 2 / 2.5
    assert (m.x[1.2].value, m.y[1.2].value) == pytest.approx((0.6 * way, 0.8 * way), abs=1e-7)


def test_a_block_that_sticks_until_the_force_is_large_enough():
    m = marched(move(contacts.pushed(), 5, 3))
    assert times(m, 'table.friction') == pytest.approx([1], abs=1e-7)
    assert (m.v[2].value, m.s[2].value) == pytest.approx((2.5, 2.5 / 3), abs=1e-7)


def test_a_ball_that_flies_into_a_corner():
    m = over_time(1.0, x=0.8, y=0.4, v=-2.0, w=-1.0)
    m.wall = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t], restitution=0.5)
    m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.y[t], restitution=0.5)
    for x, v in (('x', 'v'), ('y', 'w')):
        rate, v = m.component(f'd{x}'), m.component(v)
        m.add_component(f'way_{x}', pyo.Constraint(m.t, rule=lambda m, t, rate=rate, v=v: rate[t] == v[t]))
    m.push_x = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == m.wall[t].normal)
    m.push_y = pyo.Constraint(m.t, rule=lambda m, t: m.dw[t] == m.floor[t].normal)
    marched(move(m, 4, 2))
    assert times(m, 'wall, floor') == pytest.approx([0.4], abs=1e-7)
    assert (m.x[1].value, m.y[1].value) == pytest.approx((0.6, 0.3), abs=1e-7)


# Units

UNITS = [{'T': 1e6}, {'L': 1e-6}, {'M': 1e6}]


@pytest.mark.parametrize('units', UNITS, ids=str)
def test_units_of_a_block_at_rest(units):
    # at rest, values are 0 to round-off, from which no size follows
    T, L = units.get('T', 1), units.get('L', 1)
    m = marched(move(contacts.pushed(**units), 5, 3))
    assert [t / T for t in times(m, 'table.friction')] == pytest.approx([1], abs=1e-7)
    assert (m.v[2 * T].value * T / L, m.s[2 * T].value / L) == pytest.approx((2.5, 2.5 / 3), abs=1e-7)


@pytest.mark.parametrize('units', UNITS, ids=str)
def test_units_of_a_puck_in_space(units):
    # with equal weights of eight directions the forces of friction cancel
    T, L = units.get('T', 1), units.get('L', 1)
    m = move(contacts.puck(0.2, 8, **units), 6, 2)
    pyomo_fesd.simulate(m)
    assert m.x[1.2 * T].value / L == pytest.approx(2 * 0.2 + 1.5**2 / 2 / 2.5, abs=1e-7)


@pytest.mark.parametrize('units', UNITS, ids=str)
def test_units_of_two_discs(units):
    T, L = units.get('T', 1), units.get('L', 1)
    m = move(contacts.discs(0.5, **units), 6, 2)
    pyomo_fesd.simulate(m)
    for index, exact in contacts.after_discs(0.5).items():
        assert m.v[(*index, 2 * T)].value * T / L == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize('units', UNITS, ids=str)
def test_units_of_a_block_on_an_incline(units):
    T, L = units.get('T', 1), units.get('L', 1)
    m = marched(move(contacts.incline(0.2, **units), 5, 2))
    stop, back = 2 / G / (sin(0.3) + 0.2 * cos(0.3)), G * (sin(0.3) - 0.2 * cos(0.3))
    assert [t / T for t in times(m, 'plane.friction')] == pytest.approx([stop], abs=1e-7)
    assert m.v[1.5 * T].value * T / L == pytest.approx(-back * (1.5 - stop), abs=1e-7)


# Optimal control


def test_a_push_is_found_from_a_distance():
    # the first block shall bring the second to 3; nothing touches at the start
    m = contacts.blocks(0, (0, 1.5, 9), (0, 0, 0), 2.0)
    m.u = pyo.Var(m.t, bounds=(-10, 10), initialize=0)
    m.momentum.deactivate()

    @m.Constraint(m.i, m.t)
    def pushed(m, i, t):
        drive = m.u[t] if i == 1 else 0
        return m.dv[i, t] == drive + (m.hit[i - 1, t].normal if i > 1 else 0) - (m.hit[i, t].normal if i < 3 else 0)

    m.goal = pyo.Objective(expr=100 * (m.x[2, 2] - 3) ** 2 + 1e-3 * sum(m.u[t] ** 2 for t in m.t))
    m.t.add(0.5), m.t.add(1.0), m.t.add(1.5)
    m.del_component(m.momentum)
    move(m, 8, 2, piecewise_constant=[m.u])
    results = pyo.SolverFactory('mpec_hybrid').solve(m, relaxation='scholtes', time_limit=60)
    assert results.solver.stationarity == 'B'
    assert m.x[2, 2].value == pytest.approx(3, abs=1e-2)


# Refusals


def refused(m, match, **keywords):
    before = seen(m)
    with pytest.raises(FesdError, match=match) as error:
        move(m, 3, 2, **keywords)
    assert seen(m) == before
    return error.value


def test_a_velocity_that_is_reset_too_is_refused():
    m = contacts.ball(0)
    m.jump = pyomo_fesd.state_jump(m.t, guard=lambda m, t: 2 - m.q[t], reset=lambda m, t: [(m.v[t], 0)])
    refused(m, r'v\[.*\]: a state_jump resets it')


def test_bodies_that_collide_at_the_first_time_are_refused():
    refused(contacts.ball(0, height=0.0, speed=-1.0), 'the gap is closed at the first time and closes at a rate of 1')
