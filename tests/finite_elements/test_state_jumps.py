"""State jumps at element boundaries: the law, and whole paths with exact answers."""

import batch_reactor
import bouncing_ball
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.core.expr.visitor import identify_variables

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import moving_grids
from tests.models import collocate, snapshot
from tests.problems import resting_ball
from tests.problems.running import EXACT_SCHEMES, LEGENDRE, RADAU, SCHEMES, move, seen

TWO_POINTS = [s for s in EXACT_SCHEMES if s[1] > 1]


def marched(m):
    """Simulated, then solved from there and certified."""
    pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B' and results.solver.nlps <= 4
    return m


def times(m, name='impact'):
    """When a law of reset was at work."""
    return [s.time for s in pyomo_fesd.switches(m) if s.disjunction == name]


# The law


def test_one_variable_and_two_pairs_for_each_law_and_inner_boundary():
    m = move(bouncing_ball.build(), 5, 2)
    home = m._pyomo_fesd_elements_t.jumps
    assert len(home.e) == len(home.happens) == len(home.binary) == 4
    report = pyomo_fesd.report(m)
    # r, e, (q, v, dq, dv at ten points, dq and dv at the first time)
    assert (report['variables'], report['multipliers']) == (5 + 4 + 42, 9)
    assert (report['pairs'], report['decided']) == (8, 4)


@pytest.mark.parametrize('e, after', [(0.0, -4.0), (1.0, 3.2)])
def test_the_element_after_a_boundary_starts_from_the_value_after_the_jump(e, after):
    m = move(bouncing_ball.build(0.8), 3, 2)
    block = m._pyomo_fesd_elements_t
    grid = moving_grids(m)[m.t].grid
    block.jumps.e['impact', 1].value = e
    m.v[grid.elements[0].right].value = -4.0
    values = moving_grids(m)[m.t].state_jumps.values_after(grid.elements[0])
    assert {x.name: pyo.value(v) for x, v in values.items()} == {f'v[{grid.elements[0].right}]': pytest.approx(after)}


@pytest.mark.parametrize('scheme', SCHEMES)
def test_only_the_equations_of_the_next_element_see_it(scheme):
    m = move(bouncing_ball.build(), 3, 2, scheme=scheme)
    block = m._pyomo_fesd_elements_t
    owner, seen_in = moving_grids(m)[m.t].grid.element_of(), {}
    for c in m.component_data_objects(pyo.Constraint, active=True):
        for v in identify_variables(c.body):
            if v.parent_component() is block.jumps.e:
                seen_in.setdefault(v.index()[1], set()).add(owner[c.index()].n)
    assert seen_in == {1: {2}, 2: {3}}


def test_guards_are_kept_at_every_time():
    m = move(bouncing_ball.build(), 3, 2)
    home = m._pyomo_fesd_elements_t.jumps
    listed = [v.index() for c in home.guarded.values() for v in identify_variables(c.body, include_fixed=True)]
    inner = [e.right for e in moving_grids(m)[m.t].grid.elements[:-1]]
    assert sorted([*listed, *inner]) == list(m.t)


def test_laws_that_reset_the_same_state_share_its_value_after():
    m = bouncing_ball.build()
    m.ceiling = pyomo_fesd.state_jump(m.t, guard=lambda m, t: 2 - m.q[t], reset=lambda m, t: [(m.v[t], -m.v[t])])
    move(m, 3, 2)
    label = moving_grids(m)[m.t].grid.elements[0].right
    (found,) = moving_grids(m)[m.t].state_jumps.jumping(label).values()
    assert [name for name, _ in found] == ['impact', 'ceiling']
    assert len(m._pyomo_fesd_elements_t.jumps.after) == 2


# Whole paths


@pytest.mark.parametrize('scheme, ncp', TWO_POINTS)
def test_bouncing_ball(scheme, ncp):
    m = marched(move(bouncing_ball.build(), 10, ncp, scheme=scheme))
    assert times(m) == pytest.approx(bouncing_ball.impacts(), abs=1e-7)
    assert (m.q[3].value, m.v[3].value) == pytest.approx(bouncing_ball.end(), abs=1e-7)
    assert bouncing_ball.end() == pytest.approx((0.5386263507, 2.2645421169), abs=1e-10)


def test_the_homotopy_finds_impacts_by_itself():
    m = move(bouncing_ball.build(), 6, 2)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    assert results.solver.stationarity == 'B'
    assert times(m) == pytest.approx(bouncing_ball.impacts(), abs=1e-7)


@pytest.mark.parametrize('e, end', [(0.8, 1.5), (0.5, 1.1)])
def test_a_ball_that_loses_energy(e, end):
    m = marched(move(bouncing_ball.build(e, end), 14, 2))
    assert times(m) == pytest.approx(bouncing_ball.impacts(e, end), abs=1e-7)
    assert (m.q[end].value, m.v[end].value) == pytest.approx(bouncing_ball.end(e, end), abs=1e-7)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_two_balls_at_once(scheme):
    start = {'high': 0.8, 'low': 0.3}
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.i = pyo.Set(initialize=list(start))
    m.x = pyo.Var(m.i, ['q', 'v'], m.t, initialize=0.5)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i, q in start.items():
        m.x[i, 'q', 0].fix(q)
        m.x[i, 'v', 0].fix(0)
    m.kinematics = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dx[i, 'q', t] == m.x[i, 'v', t])
    m.fall = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dx[i, 'v', t] == -9.81)
    m.impact = pyomo_fesd.state_jump(
        m.i, m.t, guard=lambda m, i, t: m.x[i, 'q', t], reset=lambda m, i, t: [(m.x[i, 'v', t], -m.x[i, 'v', t])]
    )
    marched(move(m, 10, 2, scheme=scheme))
    for i, q in start.items():
        first = (2 * q / 9.81) ** 0.5
        exact = [first * (1 + 2 * n) for n in range(5) if first * (1 + 2 * n) < 1]
        assert times(m, f'impact[{i}]') == pytest.approx(exact, abs=1e-7)
        since = 1 - exact[-1]
        assert m.x[i, 'q', 1].value == pytest.approx(9.81 * since * (first - since / 2), abs=1e-7)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_ball_that_does_not_bounce_comes_to_rest(scheme):
    m = marched(move(resting_ball.build(), 8, 2, scheme=scheme))
    assert times(m) == pytest.approx([resting_ball.IMPACT], abs=1e-7)
    assert times(m, 'contact') == pytest.approx([resting_ball.IMPACT], abs=1e-7)
    for v, exact in ((m.q, 0), (m.v, 0), (m.F, resting_ball.FORCE)):
        assert v[resting_ball.END].value == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize('scheme, ncp, nfe', [(RADAU, 4, 16), (LEGENDRE, 3, 16)])
def test_batch_reactor(scheme, ncp, nfe):
    m = marched(move(batch_reactor.build(), nfe, ncp, scheme=scheme))
    assert times(m, 'charging') == pytest.approx(batch_reactor.resets(), abs=1e-6)
    before, product = batch_reactor.contents_at_resets()
    assert m.P[batch_reactor.HORIZON].value == pytest.approx(product, abs=1e-7)
    frame = pyomo_fesd.trajectory(m)
    for time, (B, V, P) in zip(times(m, 'charging'), before):
        last = frame[abs(frame.index - time) <= 1e-12].iloc[0]
        assert (last['B'], last['P']) == pytest.approx((B, P), abs=1e-7)
        assert last['V'] == pytest.approx(V, abs=1e-5)


def test_a_jump_on_the_boundary_of_a_stage():
    # from this height the ball falls for 0.4 s
    m = bouncing_ball.build(1.0, 1)
    m.q[0].fix(9.81 * 0.4**2 / 2)
    m.t.add(0.4)
    marched(move(m, 6, 2))
    assert times(m) == pytest.approx([0.4], abs=1e-7)
    assert m.q[1].value == pytest.approx(9.81 * 0.6 * (0.4 - 0.3), abs=1e-7)


def test_a_starting_height_that_is_to_be_found():
    # the ball shall be at 0.5 m after the first bounce, at t = 1
    m = bouncing_ball.build(1.0, 1)
    move(m, 8, 2)
    pyomo_fesd.simulate(m)
    m.q[0].unfix()
    m.goal = pyo.Objective(expr=(m.q[1] - 0.5) ** 2)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B'
    height = m.q[0].value
    first = (2 * height / 9.81) ** 0.5
    since = 1 - first
    assert 9.81 * since * (first - since / 2) == pytest.approx(0.5, abs=1e-6)


# Results


def test_lengths_are_equal_between_jumps():
    m = marched(move(bouncing_ball.build(), 12, 2))
    ends = pyomo_fesd.element_lengths(m)
    cuts = [0.0, *bouncing_ball.impacts(), 3.0]
    for a, b in zip(cuts, cuts[1:]):
        inside = ends[(ends['start'] >= a - 1e-7) & (ends['end'] <= b + 1e-7)]['length']
        assert inside.tolist() == pytest.approx([(b - a) / len(inside)] * len(inside), abs=1e-7)


def test_a_switch_tells_the_states_before_and_after():
    m = marched(move(bouncing_ball.build(0.5, 0.6), 5, 2))
    (switch,) = pyomo_fesd.switches(m)
    assert str(switch) == 'time 0.4038550219: impact  v = -3.96182 -> v = 1.98091'


# Orders, clones, refusals


@pytest.mark.parametrize('scheme', SCHEMES)
def test_declared_after_discretisation(scheme):
    early = move(bouncing_ball.build(), 10, 2, scheme=scheme)
    late = bouncing_ball.build()
    law = late.impact
    late.del_component(law)
    pyo.TransformationFactory('dae.collocation').apply_to(late, wrt=late.t, nfe=10, ncp=2, scheme=scheme)
    late.impact = pyomo_fesd.state_jump(late.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(m.v[t], -1.0 * m.v[t])])
    move(late, 10, 2)
    assert seen(early) == seen(late)


def test_create_using_and_clones():
    m = bouncing_ball.build()
    before = snapshot(m)
    copy = pyo.TransformationFactory('fesd.finite_elements').create_using(m, nfe=10, ncp=2)
    assert snapshot(m) == before
    other = copy.clone()
    for model in (copy, other):
        assert times(marched(model)) == pytest.approx(bouncing_ball.impacts(), abs=1e-7)


def refuse(m, match):
    """fesd.finite_elements refuses, and leaves the model."""
    before = snapshot(m)
    with pytest.raises(FesdError, match=match):
        move(m, 4, 2)
    assert snapshot(m) == before


@pytest.mark.parametrize('what', ['algebraic', 'derivative', 'another time'])
def test_a_reset_of_something_that_is_no_state_is_refused(what):
    m = bouncing_ball.build()
    m.a = pyo.Var(m.t, initialize=0)
    m.follow = pyo.Constraint(m.t, rule=lambda m, t: m.a[t] == m.q[t])
    reset = {'algebraic': lambda m, t: m.a[t], 'derivative': lambda m, t: m.dv[t], 'another time': lambda m, t: m.q[0]}[what]
    m.bad = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.q[t], reset=lambda m, t: [(reset(m, t), 0)])
    refuse(m, r"bad\[.*\]: '.*' is reset, but it is not a differential state at this time")


def test_a_guard_with_a_held_control_is_refused():
    m = bouncing_ball.build()
    m.floor = pyo.Var(m.t, initialize=0)
    m.del_component(m.impact)
    m.impact = pyomo_fesd.state_jump(m.t, guard=lambda m, t: m.q[t] - m.floor[t], reset=lambda m, t: [(m.v[t], -m.v[t])])
    before = snapshot(m)
    with pytest.raises(FesdError, match=r"impact: its guard contains the control 'floor\[.*\]'"):
        move(m, 4, 2, piecewise_constant=[m.floor])
    assert snapshot(m) == before


def test_a_fixed_grid_is_refused_by_the_solver():
    with pytest.raises(FesdError, match='a state jump on a grid whose elements do not move'):
        pyo.SolverFactory('mpec_hybrid').solve(collocate(bouncing_ball.build()))


def test_a_law_that_is_switched_off_does_nothing():
    m = bouncing_ball.build()
    m.impact.deactivate()
    m.hit = pyo.Constraint(m.t, rule=lambda m, t: m.q[t] >= -100)
    move(m, 4, 2)
    assert m._pyomo_fesd_elements_t.component('jumps') is None
