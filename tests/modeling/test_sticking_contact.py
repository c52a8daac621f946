"""Contacts that must not slip: exact answers, and controls with which the bodies would slip."""

import pyomo.environ as pyo
import pytest
from problems.states import over_time
from pyomo.common.collections import ComponentSet
from pyomo.core.expr.visitor import identify_variables

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import moving_grids
from pyomo_fesd.core.complementarity import read_complementarity
from tests.models import scalar_ode
from tests.problems.running import SCHEMES, move

G, MU = 10.0, 0.5


def block(height=0.0, speed=0.0, end=1.0, push=None):
    """A block of mass 1 above a table, or on it, that must not slip; ``push`` is a force along the table."""
    m = over_time(end, s=0.0, y=height, v=speed, w=0.0)
    m.u = pyo.Var(m.t, initialize=0, bounds=(-20, 20))
    if push is not None:
        m.u.fix(push)
    m.table = pyomo_fesd.contact(m.t, gap=lambda m, t: m.y[t], friction=MU, slip=lambda m, t: m.v[t], sticks=True)
    m.along = pyo.Constraint(m.t, rule=lambda m, t: m.ds[t] == m.v[t])
    m.across = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.w[t])
    m.slide = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == m.u[t] + m.table[t].friction)
    m.press = pyo.Constraint(m.t, rule=lambda m, t: m.dw[t] == -G + m.table[t].normal)
    return m


def solved(m, **options):
    return pyo.SolverFactory('mpec_hybrid').solve(m, **options).solver


def test_the_largest_push_is_that_of_the_cone():
    m = block()
    m.push = pyo.Objective(expr=m.u[1], sense=pyo.maximize)
    move(m, 2, 2, piecewise_constant=[m.u])
    assert solved(m).stationarity == 'B'
    assert m.u[1].value == pytest.approx(MU * G, abs=1e-6)
    assert pyo.value(m.table[1].friction) == pytest.approx(-MU * G, abs=1e-6)
    assert pyo.value(m.table[1].normal) == pytest.approx(G, abs=1e-6)
    assert m.v[1].value == pytest.approx(0, abs=1e-8) and m.s[1].value == pytest.approx(0, abs=1e-8)


@pytest.mark.parametrize('cross', ['element', 'full'])
@pytest.mark.parametrize('push, found', [(4.9, True), (5.1, False)])
def test_a_push_beyond_the_cone_is_infeasible(push, found, cross):
    m = move(block(push=push), 2, 2, cross_complementarity=cross)
    results = solved(m)
    assert (results.termination_condition == 'optimal') == found
    if not found:
        assert results.termination_condition == 'infeasible' and results.stationarity != 'B'


# speed 2 at the landing after 0.2 s; the impulse along the table is at most half of it
@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('speed', [0.0, 0.9, -0.9])
def test_a_landing_stops_the_slip(speed, scheme):
    m = move(block(0.2, speed, 0.5, push=0.0), 3, 2, scheme=scheme)
    assert solved(m).termination_condition == 'optimal'
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(0.2, abs=1e-6)
    assert (m.s[0.5].value, m.v[0.5].value) == pytest.approx((0.2 * speed, 0), abs=1e-6)
    impacts = moving_grids(m)[m.t].state_jumps.impacts
    assert sum(v.value for some in (impacts.impulse, impacts.second) for v in some.values()) == pytest.approx(2, abs=1e-6)


def test_a_landing_that_would_slip_has_no_solution():
    results = solved(move(block(0.2, 1.1, 0.5, push=0.0), 3, 2), max_iterations=3000)
    assert results.termination_condition in ('infeasible', 'maxIterations') and results.stationarity != 'B'


def test_the_slip_may_change_its_sign_in_flight_within_an_element():
    m = move(block(10.0, 1.0, 1.0, push=-2.0), 1, 2)
    assert solved(m).termination_condition == 'optimal'
    assert m.v[1].value == pytest.approx(-1, abs=1e-8)


def test_each_two_points_of_an_element_are_a_pair():
    pairs = {cross: len(moving_grids(m)[m.t].pairs) for cross in ('auto', 'element', 'full') for m in [pushed(cross)]}
    assert pairs['auto'] == pairs['full'] > pairs['element']


def pushed(cross):
    return move(block(push=0.0), 2, 2, cross_complementarity=cross)


@pytest.mark.parametrize('cross', ['element', 'full'])
def test_it_is_closed_only_from_a_boundary_on_at_which_the_bodies_do_not_part(cross):
    # forces of a closed element can take away a velocity upwards, which a body has that was below between two points
    m = move(block(push=0.0), 2, 2, cross_complementarity=cross)
    moving = moving_grids(m)[m.t]
    parting = moving.state_jumps.impacts.above['table', 1]
    sides = [read_complementarity(pair) for pair in moving.pairs.values()]
    forces = {v.name for side in sides if parting in ComponentSet(identify_variables(side.H)) for v in identify_variables(side.G)}
    closed = [t for t in m.t if moving.grid.elements[1].left < t]
    assert {m.table[t].find_component('_pyomo_fesd_sticking').forward.name for t in closed} <= forces


def test_it_cannot_be_simulated():
    m = move(block(push=0.0), 2, 2)
    with pytest.raises(FesdError, match=r'table: simulate: its bodies must not slip \(sticks=True\)'):
        pyomo_fesd.simulate(m)


def test_a_clone_keeps_it():
    m = block(push=0.0).clone()
    move(m, 2, 2)
    assert solved(m.clone()).termination_condition == 'optimal'


@pytest.mark.parametrize(
    'keywords, match',
    [
        ({}, 'sticks=True with no friction'),
        ({'friction': 0.3, 'slip': lambda m, t: m.x[t], 'restitution': 0.5}, 'sticks=True with restitution=0.5'),
        ({'friction': 0.3, 'slip': lambda m, t: [m.x[t], m.y[t]]}, r'floor\[0\]: sticks=True with 2 slip velocities'),
    ],
)
def test_what_it_is_not_for_is_refused(keywords, match):
    m = scalar_ode()
    with pytest.raises(FesdError, match=match):
        m.floor = pyomo_fesd.contact(m.t, gap=lambda m, t: m.x[t], sticks=True, **keywords)
