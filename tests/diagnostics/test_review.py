"""What a solution overlooks or leaves open: warned of where it is so, and only there."""

import bouncing_ball
import gas_liquid_tank
import oscillator
import pyomo.environ as pyo
import pytest
import signum
import thermostat
from pyomo.gdp import Disjunction

import pyomo_fesd
from pyomo_fesd.diagnostics.review import diagnose
from pyomo_fesd.results.switching_functions import switching_functions
from tests.models import dcs
from tests.problems import air_friction, gears, resting_ball, sliding, two_systems
from tests.problems.running import SCHEMES, move, run, seen, transform
from tests.problems.states import over_time

NOT_UNIQUE, EXCURSION = 'the solution is not unique', 'between two collocation points'


def relay(below, above, x0, end=1.5, scale=1.0):
    """dx/dt = below where x < 0, above where x > 0."""
    m = over_time(end, x=x0 * scale)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == below * scale], [m.x[t] >= 0, m.dx[t] == above * scale]])
    return m


def solved(m, **keywords):
    """Solved whatever the solver says; returns its warnings."""
    return pyo.SolverFactory('mpec_hybrid').solve(m, **keywords).solver.warnings


# Not unique


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('scale', [1.0, 1e-3, 1e5])
def test_a_start_on_a_boundary_that_repels_is_said(scheme, scale, caplog):
    m = transform(relay(-1, 1, 0.0, scale=scale), 6, 2, scheme=scheme)
    (message,) = solved(m)
    assert message.startswith('sgn: at time 0 both modes lead away') and NOT_UNIQUE in message
    assert [r.getMessage() for r in caplog.records] == [message]


def test_so_it_is_by_simulate(caplog):
    pyomo_fesd.simulate(transform(relay(-1, 1, 0.0), 6, 2))
    assert [NOT_UNIQUE in r.getMessage() for r in caplog.records] == [True]


@pytest.mark.parametrize(
    'below, above, x0',
    [(1, -1, -0.5), (1, -1, 0.0), (3, 1, -1.0), (3, 1, 0.0), (-3, -1, 0.0), (-1, 1, -0.5), (-1, 1, 0.5)],
    ids=['slides', 'slides at once', 'crosses', 'starts upwards', 'starts downwards', 'leaves below', 'leaves above'],
)
def test_slides_crossings_and_starts_elsewhere_are_not_warned_of(below, above, x0):
    assert solved(transform(relay(below, above, x0), 6, 2)) == []


def test_a_slide_that_begins_to_repel_is_said():
    # the surface x = 0 attracts until c = 1 and repels after it: with x = 0 all along, nu = 1/2
    m = over_time(2, x=0, c=0)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dc[t] == 1)
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 1 - m.c[t]], [m.x[t] >= 0, m.dx[t] == m.c[t] - 1]])
    m.t.add(1)
    transform(m, 4, 2)
    block = m._pyomo_fesd_dcs.sgn
    for v in (m.x, m.dx, block.p, block.n):
        v[...].set_value(0.0)
    block.alpha[...].set_value(0.5)
    for t in m.t:
        m.c[t].set_value(t)
        m.dc[t].set_value(1)
    m.c[0].set_value(-1)  # the slide began before
    assert diagnose(m) == []


def test_rates_through_algebraic_variables():
    # x' = u with u defined by the modes
    m = over_time(1.5, x=0)
    m.u = pyo.Var(m.t, initialize=0)
    m.w = pyo.Var(m.t, initialize=0)
    m.chain = pyo.Constraint(m.t, rule=lambda m, t: m.w[t] == 2 * m.u[t])
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: 2 * m.dx[t] == m.w[t])
    m.sgn = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.u[t] == -1], [m.x[t] >= 0, m.u[t] == 1]])
    assert [NOT_UNIQUE in w for w in solved(transform(m, 6, 2))] == [True]


@pytest.mark.parametrize('below, said', [(1, False), (-1, True)], ids=['attracts', 'repels'])
def test_free_controls_do_not_turn_a_rate_round(below, said):
    # x' = y + u with y by the modes; the output s contains both, and its equation alone would let u follow y
    m = over_time(2, x=0)
    m.u, m.y, m.s = (pyo.Var(m.t, initialize=0) for _ in range(3))
    m.d = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.y[t] == below], [m.x[t] >= 0, m.y[t] == -below]])
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.y[t] + m.u[t])
    m.output = pyo.Constraint(m.t, rule=lambda m, t: m.s[t] == m.u[t] + 3 * m.y[t])
    m.cost = pyo.Objective(expr=sum(m.u[t] ** 2 for t in m.t))
    assert any(NOT_UNIQUE in w for w in solved(move(dcs(m), 4, 2, piecewise_constant=[m.u]))) is said


def test_each_disjunction_is_looked_at_by_itself():
    m = over_time(1.5, x=0, y=-0.5)
    m.leaves = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == -1], [m.x[t] >= 0, m.dx[t] == 1]])
    m.stays = Disjunction(m.t, rule=lambda m, t: [[m.y[t] <= 0, m.dy[t] == 1], [m.y[t] >= 0, m.dy[t] == -1]])
    (message,) = solved(transform(m, 6, 2))
    assert message.startswith('leaves: ')


def two_relays(slopes, x0, scale=1.0):
    """(x, y)' = slopes (sgn x, sgn y)."""
    m = over_time(1.5, x=x0[0] * scale, y=x0[1] * scale)
    m.u, m.v = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
    m.sgn_x = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.u[t] == -1], [m.x[t] >= 0, m.u[t] == 1]])
    m.sgn_y = Disjunction(m.t, rule=lambda m, t: [[m.y[t] <= 0, m.v[t] == -1], [m.y[t] >= 0, m.v[t] == 1]])
    (a, b), (c, d) = slopes
    m.ode_x = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == scale * (a * m.u[t] + b * m.v[t]))
    m.ode_y = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == scale * (c * m.u[t] + d * m.v[t]))
    return m


@pytest.mark.parametrize('scale', [1.0, 1e-3, 1e5])
@pytest.mark.parametrize(
    'slopes, said',
    [
        # x = 0 repels while y keeps its mode, but y turns round where x leaves
        (((0.5, 2), (-2, -1)), []),
        (((0.5, 0), (-2, -1)), ['sgn_x']),
        # both leave together
        (((0.5, 2), (2, -1)), ['sgn_x']),
        (((0.5, 2), (2, 0.5)), ['sgn_x', 'sgn_y']),
        (((-1, 0.5), (0.5, -1)), []),
    ],
)
def test_where_surfaces_meet_all_ways_of_leaving_are_counted(slopes, said, scale):
    m = transform(two_relays(slopes, (0, 0), scale), 4, 2)
    pyomo_fesd.simulate(m)
    assert [message.partition(':')[0] for message in diagnose(m) if NOT_UNIQUE in message] == said


def test_stewarts_form_has_no_switching_functions():
    m = transform(relay(-1, 1, 0.0), 6, 2, form='stewart')
    assert switching_functions(m, m.t) == []


# Excursions


def thrown(start, nfe):
    """x' = v, v' = -1 from x = -start with v = 2, so x = 2 t - t^2/2 - start; dz/dt = 1 while x > 0."""
    m = over_time(4, x=-start, v=2, z=0)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.v[t])
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -1)
    m.up = Disjunction(m.t, rule=lambda m, t: [[m.x[t] >= 0, m.dz[t] == 1], [m.x[t] <= 0, m.dz[t] == 0]])
    return transform(m, nfe, 3)


@pytest.mark.parametrize('start, nfe', [(1.999, 3), (1.999, 6), (1.95, 2), (1.95, 3), (1.5, 3)])
def test_an_even_root_within_an_element_is_found_or_said(start, nfe):
    m = thrown(start, nfe)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    said = any(EXCURSION in w and w.startswith('up: near time ') for w in results.solver.warnings)
    found = abs(m.z[4].value - 2 * (4 - 2 * start) ** 0.5) <= 1e-6
    # two elements cannot hold three stretches: there is no solution on such a grid
    assert results.solver.stationarity == 'B' or nfe == 2
    assert found != (said or results.solver.stationarity != 'B')
    assert nfe != 6 or found


def test_what_stays_away_is_not_warned_of():
    for nfe in (2, 3, 6):
        assert solved(thrown(2.05, nfe)) == []


RATES = {'exp': lambda c: pyo.exp(c - 1), 'cubic': lambda c: c**3, 'sine': lambda c: 1.3 * pyo.sin(c)}


def leaving_smoothly(rate, nfe, ncp, scheme):
    """x' = rate(t) - sgn(x): x = 0 attracts until the rate is 1, and x leaves without a slope."""
    m = over_time(2.5, x=-0.2, c=0)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dc[t] == 1)
    drift = RATES[rate]
    m.s = Disjunction(
        m.t,
        rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == drift(m.c[t]) + 1], [m.x[t] >= 0, m.dx[t] == drift(m.c[t]) - 1]],
    )
    return transform(m, nfe, ncp, scheme=scheme)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('nfe, ncp', [(6, 2), (20, 2), (6, 3)])
@pytest.mark.parametrize('rate', RATES)
def test_a_smooth_exit_from_a_slide_is_not_warned_of(rate, nfe, ncp, scheme):
    m = leaving_smoothly(rate, nfe, ncp, scheme)
    pyomo_fesd.simulate(m)
    assert diagnose(m) == []


def test_a_slide_between_two_collocation_points_is_said():
    # x reaches 0 at t = 0.16 and slides until t = 0.365, all before the second point of an element
    m = over_time(2.5, x=-0.2, c=0)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dc[t] == 1)
    m.s = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] <= 0, m.dx[t] == 1.5 * pyo.sin(2 * m.c[t]) + 1],
            [m.x[t] >= 0, m.dx[t] == 1.5 * pyo.sin(2 * m.c[t]) - 1],
        ],
    )
    pyomo_fesd.simulate(transform(m, 6, 2))
    assert [EXCURSION in w for w in diagnose(m)] == [True]


def test_a_condition_of_a_mode_with_hysteresis():
    # heating goes through 20 between two points of the one element, and comes back
    m = over_time(4, y=18.5, v=2)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == -1)
    m.relay = Disjunction(m.t, rule=lambda m, t: [[m.y[t] <= 20, m.dy[t] == m.v[t]], [m.y[t] >= 10, m.dy[t] == m.v[t]]])
    m.relay[0].disjuncts[0].indicator_var.fix(True)
    move(dcs(m, hysteresis=m.relay), 1, 2)
    assert [EXCURSION in w for w in solved(m)] == [True]


def test_a_guard():
    m = over_time(4, q=1.9, v=-2)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == 1)
    m.impact = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -m.v[t])])
    assert [w.split(':')[0] for w in solved(move(m, 1, 3))] == ['impact']


def falling(q, v, force, end, restitution=0):
    """A body above the ground: q' = v, v' = force(t) + N."""
    m = over_time(end, q=q, v=v, c=0)
    m.clock = pyo.Constraint(m.t, rule=lambda m, t: m.dc[t] == 1)
    m.touch = pyomo_fesd.contact(m.t, gap=lambda m, t: m.q[t], restitution=restitution)
    m.kinematics = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])
    m.momentum = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == force(m.c[t]) + m.touch[t].normal)
    return m


def test_bodies_that_go_through_one_another_between_two_points():
    m = move(falling(1.9, -2, lambda c: 1, 4), 1, 3)
    assert [w.split(' ')[:3] for w in solved(m)] == [['touch:', 'near', 'time']]


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize(
    'q, v, force, restitution',
    [
        (0.5, 0, lambda c: -2, 0),
        (0.5, 0, lambda c: -2, 0.8),
        (0, 0, lambda c: pyo.exp(c - 1) - 1, 0),
        (0, 0, lambda c: pyo.sin(5 * c) - 1, 0),
    ],
    ids=['stays', 'bounces', 'leaves', 'leaves and lands'],
)
def test_contacts_are_not_warned_of(q, v, force, restitution, scheme):
    m = move(falling(q, v, force, 2, restitution), 12, 2, scheme=scheme)
    pyomo_fesd.simulate(m)
    assert diagnose(m) == []


# Good solutions


@pytest.mark.parametrize(
    'build',
    [signum.build, gas_liquid_tank.build, oscillator.build, sliding.build, sliding.build_curved, two_systems.build],
)
def test_filippov_systems_are_not_warned_of(build):
    assert solved(transform(build(), 20, 3)) == []


@pytest.mark.parametrize('scheme', SCHEMES)
def test_jumps_and_hysteresis_are_not_warned_of(scheme, caplog):
    for m in (
        move(bouncing_ball.build(), 10, 2, scheme=scheme),
        move(resting_ball.build(), 8, 2, scheme=scheme),
        transform(air_friction.build(), 10, 2, scheme=scheme),
        thermostat.transform(thermostat.build(1), 6, 2, scheme),
    ):
        pyomo_fesd.simulate(m)
    m = gears.build()
    pyomo_fesd.simulate(move(dcs(m, hysteresis=[m.gear]), 14, 1, scheme=scheme))
    assert not caplog.records


def test_looking_changes_nothing():
    m = run(two_systems.build(), 8, 2)
    before = seen(m)
    diagnose(m)
    assert seen(m) == before


def test_only_grids_on_what_is_solved():
    m = transform(relay(-1, 1, 0.0), 6, 2)
    m.side = pyo.Block()
    m.side.x = pyo.Var(initialize=0)
    solved(m)
    assert diagnose(m.side) == [] and len(diagnose(m)) == 1


def test_the_new_interface_reports_them_too():
    from pyomo.contrib.solver.common.factory import SolverFactory

    results = SolverFactory('mpec_hybrid').solve(transform(relay(-1, 1, 0.0), 6, 2))
    assert [NOT_UNIQUE in w for w in results.extra_info.warnings] == [True]
