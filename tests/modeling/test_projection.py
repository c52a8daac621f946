"""Projected dynamics: states that are kept in a set by a force along the gradient of its walls."""

import projected_ellipse
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd import FesdError, projection
from tests.problems import round_the_circle as circle
from tests.problems.running import LEGENDRE, SCHEMES, move, seen, solve

# A point on a circle


def end(m):
    return [m.x[m.t.last(), i].value for i in (1, 2)]


@pytest.mark.parametrize(
    'wall',
    [
        lambda x, y: x**2 + y**2 - 1,
        lambda x, y: x**2 + y**2 >= 1,
        lambda x, y: 1 <= x**2 + y**2,
        lambda x, y: [1 - x**2 - y**2 <= 0],
    ],
    ids=['expression', 'inequality', 'other order', 'list'],
)
def test_a_point_slides_round_a_circle(wall):
    m = solve(move(circle.build(wall), 12, 3))
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(circle.CONTACT, abs=1e-9)
    assert end(m) == pytest.approx(circle.exact(circle.HORIZON), abs=5e-8)


def errors(nfe, ncp):
    """Largest error of the end point, and of the force while the point slides."""
    m = solve(move(circle.build(), nfe, ncp))
    frame = pyomo_fesd.trajectory(m)
    assert frame['circle.lam'][frame.index < circle.CONTACT - 1e-6].abs().max() <= 1e-9
    on = frame[frame.index > circle.CONTACT + 1e-6]
    # grad c = 2 x, so the part x of the velocity (1, 0) along the unit normal is what 2 lam must cancel
    force = (2 * on['circle.lam'] + on['x[1]']).abs().max()
    return max(abs(a - b) for a, b in zip(end(m), circle.exact(circle.HORIZON))), force


def test_errors_fall_with_the_order_of_the_scheme():
    # the multiplier of a constraint on states is of order K, the states are of higher order
    (coarse, rough), (fine, smooth) = errors(12, 3), errors(24, 3)
    assert fine <= 1e-9 and coarse / fine > 2**5 * 0.8
    assert rough <= 1e-3 and rough / smooth > 2**3 * 0.8


def test_a_metric_turns_the_push():
    # E = diag(1, 0): only x is pushed, so the point stays where it meets the circle
    m = solve(move(circle.build(metric=[[1, 0], [0, 0]]), 12, 3))
    assert end(m) == pytest.approx([-(0.99**0.5), 0.1], abs=1e-8)


def test_gauss_is_warned_of_by_the_name_of_the_block(caplog):
    move(circle.build(), 12, 2, scheme=LEGENDRE)
    assert [r.message.split(':')[0] for r in caplog.records if 'curved' in r.message] == ['circle.contact']


def test_it_costs_one_multiplier_and_one_pair_for_each_wall():
    bare = circle.plant()
    bare.ode = pyo.Constraint(bare.t, bare.i, rule=lambda m, t, i: m.dx[t, i] == 0)
    small, large = (pyomo_fesd.report(m) for m in (move(bare, 6, 2), move(circle.build(), 6, 2)))
    # lam and the sign of c at 13 times; 6 lengths, whose sum is there in both
    assert (large['variables'] - small['variables'], large['constraints'] - small['constraints']) == (13 + 6, 13)
    assert large['pairs'] == 7


# Walls


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_point_slides_along_a_wall_into_a_corner(scheme):
    # rate (2, 1) from (0, 0) with x + y <= 3 and x <= 2.5: contact at t = 1, along the wall at rate (1/2, -1/2), corner at t = 2
    m = circle.plant(horizon=3.0, start=(0.0, 0.0))

    @m.Block(m.t)
    def room(b, t):
        x, y = m.x[t, 1], m.x[t, 2]
        push = projection(b, [x + y <= 3, x <= 2.5], [x, y])
        b.ode = pyo.Constraint(m.i, rule=lambda b, i: m.dx[t, i] == (2, 1)[i - 1] + push[m.x[t, i]])

    solve(move(m, 9, 2, scheme=scheme))
    assert [(s.disjunction, round(s.time, 8)) for s in pyomo_fesd.switches(m)] == [('room.contact[1]', 1), ('room.contact[2]', 2)]
    assert end(m) == pytest.approx([2.5, 0.5], abs=1e-8)
    assert (m.room[3].lam[1].value, m.room[3].lam[2].value) == pytest.approx((1, 1), abs=1e-8)


def test_a_wall_may_move_with_a_clock():
    # dx/dt = 0 pushed ahead of x >= t - 1
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 3))
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)

    @m.Block(m.t)
    def piston(b, t):
        push = projection(b, m.x[t] - pyomo_fesd.clock(m)[t] + 1, [m.x[t]])
        b.ode = pyo.Constraint(expr=m.dx[t] == push[m.x[t]])

    solve(move(m, 6, 2))
    assert pyomo_fesd.switches(m)[0].time == pytest.approx(1, abs=1e-9)
    assert m.x[3].value == pytest.approx(2, abs=1e-9)


def test_named_expressions_are_differentiated_through():
    m = circle.plant()
    m.r2 = pyo.Expression(m.t, rule=lambda m, t: m.x[t, 1] ** 2 + m.x[t, 2] ** 2)

    @m.Block(m.t)
    def circle_(b, t):
        x = [m.x[t, 1], m.x[t, 2]]
        push = projection(b, pyo.sqrt(m.r2[t]) - 1, x)
        b.ode = pyo.Constraint(m.i, rule=lambda b, i: m.dx[t, i] == (1, 0)[i - 1] + push[m.x[t, i]])

    solve(move(m, 12, 3))
    assert end(m) == pytest.approx(circle.exact(circle.HORIZON), abs=5e-8)


def test_it_may_be_called_on_a_grid_that_was_there_and_on_copies():
    m = circle.plant()
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=12, ncp=3)

    @m.Block(m.t)
    def wall(b, t):
        m = b.model()
        x = [m.x[t, 1], m.x[t, 2]]
        push = projection(b, x[0] ** 2 + x[1] ** 2 >= 1, x)
        b.ode = pyo.Constraint(m.i, rule=lambda b, i: m.dx[t, i] == (1, 0)[i - 1] + push[m.x[t, i]])

    copy = m.clone()
    other = pyo.TransformationFactory('fesd.finite_elements').create_using(circle.build(), nfe=12, ncp=3)
    for model in (move(m), move(copy), other):
        assert end(solve(model)) == pytest.approx(circle.exact(circle.HORIZON), abs=5e-8)


POINT = circle.build()


@settings(max_examples=60, deadline=None)
@given(*[st.floats(-3, 3)] * 4, st.floats(0, 5), st.floats(0, 5))
def test_the_push_is_metric_times_gradients_times_forces(x, y, e, f, first, second):
    b, states = pyo.Block(concrete=True), [POINT.x[3.0, 1], POINT.x[3.0, 2]]
    push = projection(b, [states[0] ** 2 * states[1] - 1, pyo.exp(states[0]) <= 2], states, metric=[[1, e], [f, 2]])
    for v, now in zip((*states, *b.lam.values()), (x, y, first, second)):
        v.set_value(now, skip_validation=True)
    forces = [2 * x * y * first - pyo.exp(x) * second, x**2 * first]
    expected = [forces[0] + e * forces[1], f * forces[0] + 2 * forces[1]]
    assert [pyo.value(push[v]) for v in states] == pytest.approx(expected, rel=1e-9, abs=1e-9)


# Refusals


def refused(message, c, states=None, metric=None, prepare=None):
    m = circle.plant()
    m.h = pyo.Var(m.t, initialize=1)
    m.b = pyo.Block()
    if prepare is not None:
        prepare(m)
    before = seen(m)
    x = [m.x[0, 1], m.x[0, 2]]
    with pytest.raises(FesdError, match=message):
        projection(m.b, c(m, *x), x if states is None else states(m, *x), metric)
    assert seen(m) == before


@pytest.mark.parametrize(
    'message, keywords',
    [
        ("the start is outside, '.*' is -0.5", {'c': lambda m, x, y: x + 1.5}),
        (r"h\[0\]: projection: the wall '.*' contains it", {'c': lambda m, x, y: x + m.h[0] + 9}),
        ("does not depend on the states", {'c': lambda m, x, y: y, 'states': lambda m, x, y: [x]}),
        ("the metric is not 2 x 2", {'c': lambda m, x, y: y, 'metric': [[1, 2]]}),
        ("'.*' is not one inequality", {'c': lambda m, x, y: x == y}),
        ("'.*' is not one inequality", {'c': lambda m, x, y: pyo.inequality(0, y, 1)}),
        ("it has a component 'lam' already", {'c': lambda m, x, y: y, 'prepare': lambda m: setattr(m.b, 'lam', pyo.Var())}),
        ("cannot be differentiated", {'c': lambda m, x, y: pyo.ceil(y)}),
    ],
    ids=['outside', 'algebraic', 'no state', 'metric', 'equality', 'range', 'twice', 'function'],
)
def test_what_cannot_be_a_wall_is_refused(message, keywords):
    refused(message, **keywords)


def test_it_is_called_with_one_block():
    m = circle.plant()
    m.b = pyo.Block(m.t)
    with pytest.raises(FesdError, match='^b: projection: not one block'):
        projection(m.b, m.x[0, 1], [m.x[0, 1]])


def test_a_start_that_is_fixed_outside_later_is_found_infeasible_by_name():
    m = circle.build()
    move(m, 4, 2)
    m.x[0, 1].fix(-0.5)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, load_solutions=False)
    assert results.solver.termination_condition == 'infeasible'
    assert 'nonnegative' in results.solver.reason or 'circle' in results.solver.reason


def test_conditions_are_ordinary_complementarities():
    m = circle.build()
    assert all(isinstance(b.contact, Complementarity) for b in m.circle.values())


# The ellipse


def test_the_point_round_the_ellipse_is_where_shooting_brings_it():
    m = projected_ellipse.build(stages=10)
    results = projected_ellipse.solve(m, elements=40)
    assert results.solver.stationarity == 'B'
    # scipy: SLSQP over ten pairs of controls, the flow by DOP853 with the contact located and the field projected by hand
    assert pyo.value(m.effort) == pytest.approx(1.5536687212, abs=1e-6)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(0.4267694619, abs=1e-6)
