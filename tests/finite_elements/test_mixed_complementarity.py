"""Conditions over time with two bounds on one side, however they are written, become two pairs (theory, below eq. 14)."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.common.timing import HierarchicalTimer
from pyomo.mpec import Complementarity, ComplementarityList, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import all_switched_systems, moving_grids
from pyomo_fesd.core.complementarity import read_complementarity
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from tests.problems import relay, walls, weir
from tests.problems.running import EXACT_SCHEMES, LEGENDRE, RADAU, SCHEMES, move, seen, solve, transform

FORMS = ('element', 'point', 'full')


def grid(m):
    return m.component('_pyomo_fesd_elements_t')


def collocate(m, scheme=RADAU):
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=5, ncp=2, scheme=scheme)


def slides(m):
    """The relay reaches zero at its time and stays there, its switch between the two positions."""
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(relay.SWITCH, abs=1e-9)
    assert (switch.before, switch.after) == ('at lower bound', 'between')
    assert m.x[2].value == pytest.approx(0, abs=1e-9)
    assert m.z[2].value == pytest.approx(relay.SLIDING, abs=1e-8)


# However it is written


@pytest.mark.parametrize('way', [*relay.WAYS, 'block', 'list'])
def test_every_way_to_write_a_relay_gives_the_same_slide(way):
    m = solve(move(relay.build(way), 5, 2))
    slides(m)
    assert pyomo_fesd.report(m)['pairs'] == 2 * 6


@pytest.mark.parametrize('cross', FORMS)
@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_a_relay_slides_with_every_scheme(scheme, ncp, cross):
    slides(solve(move(relay.build(), 5, ncp, scheme=scheme, cross_complementarity=cross)))


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_relay_on_a_grid_that_was_there_slides_too(scheme):
    slides(solve(move(relay.build(discretise=lambda m: collocate(m, scheme)))))


@pytest.mark.parametrize('side', ['low', 'high', 'infinite'])
def test_one_bound_is_an_ordinary_pair(side):
    m = weir.build()
    m.del_component(m.overflow)
    written = {
        'low': lambda m, t: complements(pyo.inequality(0, m.F[t], None), weir.V_MAX - m.V[t]),
        'high': lambda m, t: complements(pyo.inequality(None, m.V[t], weir.V_MAX), -m.F[t]),
        'infinite': lambda m, t: complements(pyo.inequality(0, m.F[t], float('inf')), weir.V_MAX - m.V[t]),
    }[side]
    m.overflow = Complementarity(m.t, rule=written)
    solve(move(m, 5, 2))
    assert m.V[2].value == pytest.approx(weir.V_MAX, abs=1e-9)
    assert pyomo_fesd.report(m)['pairs'] == 6
    assert not [b for b in m.component_objects(pyo.Block) if b.local_name == '_pyomo_fesd_mixed']


def test_several_conditions_in_a_list_in_a_block_are_told_apart():
    m = relay.build()
    m.del_component(m.relay)
    m.y = pyo.Var(m.t, initialize=1)

    @m.Block(m.t)
    def b(b, t):
        m = b.model()
        b.both = ComplementarityList(rule=[complements(m.z[t], -m.x[t]), complements(m.x[t] <= 5, m.y[t] >= 0)])

    solve(move(m, 5, 2))
    (switch,) = pyomo_fesd.switches(m)
    assert switch[1:] == ('b.both[1]', 'at lower bound', 'between')


def test_a_list_filled_for_every_time_is_refused_as_its_switches_would_be_missed():
    m = relay.build()
    m.del_component(m.relay)
    m.relay = ComplementarityList(rule=(complements(m.z[t], -m.x[t]) for t in m.t))
    before = seen(m)
    with pytest.raises(FesdError, match='^relay: conditions for every time that are not indexed by time'):
        move(m, 5, 2)
    assert seen(m) == before


def test_a_list_filled_for_every_time_of_a_grid_is_refused_too():
    m = relay.build(discretise=collocate)
    m.del_component(m.relay)
    m.relay = ComplementarityList(rule=(complements(m.z[t], -m.x[t]) for t in m.t if t > 0))
    with pytest.raises(FesdError, match='^relay: .*not indexed by time'):
        move(m)


def test_a_condition_at_the_end_alone_is_none_of_them():
    m = weir.build()
    m.y = pyo.Var(bounds=(0, None), initialize=1)
    m.last = ComplementarityList(rule=[complements(m.y >= 0, m.V[2] >= 0)])
    assert solve(move(m, 5, 2)).y.value == pytest.approx(0, abs=1e-9)


def test_conditions_of_both_ends_are_none_of_them():
    m = weir.build()
    m.y = pyo.Var(bounds=(0, None), initialize=1)
    m.ends = Complementarity(
        [1, 2], rule=lambda m, k: complements(m.y, m.V[2]) if k == 2 else complements(m.V[0] >= 0, m.F[0] >= 0)
    )
    solve(move(m, 5, 2))


# What is continuous


def no_doubt(caplog):
    return not [r for r in caplog.records if 'continuous in time' in r.message]


@pytest.mark.parametrize('measured', [False, True], ids=['state', 'algebraic'])
@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_state_between_two_walls_comes_and_goes(scheme, measured, caplog):
    m = walls.build(measured)
    solve(move(m, 9, 2, scheme=scheme, piecewise_constant=[m.f]))
    assert no_doubt(caplog)
    found = pyomo_fesd.switches(m)
    assert [s.time for s in found] == pytest.approx([t for t, _, _ in walls.SWITCHES], abs=1e-9)
    assert [(s.before, s.after) for s in found] == [s[1:] for s in walls.SWITCHES]
    for t, now in pyomo_fesd.physical_time(m).items():
        assert m.x[t].value == pytest.approx(walls.exact(now), abs=1e-9)


def recorded(m, name):
    return [v.parent_component().local_name for v in getattr(all_switched_systems(m), name)]


@pytest.mark.parametrize('way', ['inequality', 'block'])
def test_the_two_parts_of_a_continuous_function_are_recorded_as_continuous(way):
    m = move(relay.build(way), 3, 1)
    assert set(recorded(m, 'continuous')) == {'p', 'n'}
    assert len(recorded(m, 'continuous')) == 2 * len(m.t) and not recorded(m, 'selectors')
    for suffix in m.component_data_objects(pyo.Suffix):
        assert all(rule.local_name == 'split' for rule in suffix.values() if suffix.local_name == 'fesd_continuous')


def test_the_two_parts_of_a_function_that_jumps_are_free_to_jump():
    m = walls.build()
    move(m, 3, 1, piecewise_constant=[m.f])
    assert set(recorded(m, 'selectors')) == {'p', 'n'} and not recorded(m, 'continuous')


def squeezed(continuous=()):
    """dx/dt = 1, and w in [0, 2] with w = 0 below, 2 above x = 1 as  0 <= w <= 2  perp  1 - x + y, where nothing tells of y."""
    m = relay.plant(0.0)
    m.del_component(m.ode)
    m.y, m.w = pyo.Var(m.t, initialize=0), pyo.Var(m.t, bounds=(0, 2), initialize=0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1 + m.z[t])
    m.zero = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == 0)
    m.loop = pyo.Constraint(m.t, rule=lambda m, t: m.y[t] == 0 * m.w[t])
    m.valve = Complementarity(m.t, rule=lambda m, t: complements(m.w[t], 1 - m.x[t] + m.y[t]))
    return m


def test_where_nothing_tells_what_is_continuous_there_is_one_warning_with_the_users_name(caplog):
    m = squeezed()
    m.loop.deactivate()
    move(m, 4, 2)
    (record,) = [r for r in caplog.records if 'continuous in time' in r.message]
    assert record.message.startswith('valve: neither side')


@pytest.mark.parametrize('told', ['y', 'w'])
def test_what_the_user_tells_settles_it(told, caplog):
    m = squeezed()
    m.loop.deactivate()
    move(m, 4, 2, continuous=[m.component(told)])
    assert no_doubt(caplog)
    assert bool(recorded(m, 'continuous')) is (told == 'y')


# The first time, given values, bounds


def test_at_the_first_time_it_holds_as_well():
    m = relay.build()
    m.cost = pyo.Objective(expr=-m.z[0])
    solve(move(m, 5, 2))
    assert m.z[0].value == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize('position, F', [(0, 1.5), (0.5, 0), (1, -1.5)])
def test_a_variable_that_is_fixed_at_all_times_leaves_what_the_function_has_to_be(position, F):
    m = relay.plant(0.0)
    m.del_component(m.ode)
    m.z.fix(position)
    m.y = pyo.Var(m.t, bounds=(-1.5, 1.5), initialize=0.1)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.y[t])
    m.relay = Complementarity(m.t, rule=lambda m, t: complements(pyo.inequality(0, m.z[t], 1), m.y[t]))
    m.cost = pyo.Objective(expr=-m.x[2] if F >= 0 else m.x[2])
    solve(move(m, 4, 2, piecewise_constant=[m.z]))
    assert m.x[2].value == pytest.approx(2 * F, abs=1e-6)
    report = pyomo_fesd.report(m)
    assert report['pairs'] == 0 and not any(v.name.startswith('_pyomo_fesd_mixed') for v in variables(m))


def variables(m):
    return list(m.component_data_objects(pyo.Var, descend_into=True))


def test_a_variable_that_is_fixed_outside_its_bounds_is_refused():
    m = relay.build()
    m.z.fix(1.5, skip_validation=True)
    before = seen(m)
    with pytest.raises(FesdError, match=r"^relay\[0\]: 'z\[0\]' is fixed to 1.5, outside its bounds 0 and 1"):
        move(m, 4, 2, piecewise_constant=[m.z])
    assert seen(m) == before


def test_equal_bounds_leave_the_variable_at_them_and_the_function_free():
    m = relay.plant(0.0)
    m.relay = Complementarity(m.t, rule=lambda m, t: complements(pyo.inequality(0.25, m.z[t], 0.25), -m.x[t]))
    solve(move(m, 2, 2))
    assert m.x[2].value == pytest.approx(2 * (3 * 0.75 - 0.25), abs=1e-9)
    assert pyomo_fesd.report(m)['pairs'] == 0


@pytest.mark.parametrize('way', ['Params', 'declared Params'])
def test_bounds_that_are_mutable_params_follow_their_values(way):
    m = solve(move(relay.build(way), 5, 2))
    m.low.set_value(0.5)  # the relay then never closes fully: x rises at rate 3/2 - 1/2
    solve(m)
    assert m.x[2].value == pytest.approx(0, abs=1e-9)
    assert pyomo_fesd.switches(m) == [] and m.z[1.2].value == pytest.approx(0.5, abs=1e-9)


def test_bounds_that_are_parameters_of_a_kept_instance_follow_their_values():
    m = move(relay.build('Params'), 5, 2)
    solver = pyo.SolverFactory('mpec_hybrid')
    solver.set_instance(m, parameters=[m.low])
    for low in (0.0, 0.25, 0.0):
        m.low.set_value(low)
        pyo.assert_optimal_termination(solver.solve(m))
        assert pyomo_fesd.switches(m)[0].time == pytest.approx(2 / (3 - 4 * low), abs=1e-9)


# The law


@settings(max_examples=60, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.booleans())
def test_the_pairs_hold_exactly_where_the_condition_does(x, F, at_a_bound):
    m, x = RELAY, min(max(x, 0.0), 1.0) if at_a_bound else x
    m.z[2].set_value(x, skip_validation=True)
    m.x[2].set_value(-F)
    split = moving_grids(m)[m.t].splits[m.relay[2]]
    p, n = split.p, split.n
    p.value, n.value = max(F, 0.0), max(-F, 0.0)
    block = p.parent_block()
    assert pyo.value(block.split[2].body) == pytest.approx(0, abs=1e-12)
    sides = [tuple(map(pyo.value, read_complementarity(block.complementarity[2, part]))) for part in ('lower', 'upper')]
    holds = 0 <= x <= 1 and (F == 0 or x == (0 if F > 0 else 1))
    assert all(min(G, H) == 0 for G, H in sides) is holds


RELAY = move(relay.build(), 2, 1)


# What is left on the model, and what is asked of it


def test_a_relay_costs_less_than_a_disjunction_that_gives_its_position():
    small, large = (pyomo_fesd.report(m) for m in (move(relay.build(), 5, 2), transform(relay.build_disjunction(), 5, 2)))
    # at each of 11 times one multiplier and one equation less
    assert {name: large[name] - small[name] for name in small if large[name] != small[name]} == {
        'variables': 11,
        'multipliers': 11,
        'constraints': 11,
        'disjunctions': 11,
    }


@pytest.mark.parametrize('scheme', SCHEMES)
def test_the_counts_are_those_of_what_the_solver_compiles(scheme):
    m = move(relay.build(), 6, 2, scheme=scheme)
    problem, report = compile_mpcc(read_mpcc(m), HierarchicalTimer()), pyomo_fesd.report(m)
    assert (report['variables'], report['constraints']) == (len(problem.variables), len(problem.constraints))
    assert report['pairs'] + report['decided'] == len(problem.conditions) + problem.eta.numel()


def test_each_pair_tells_the_condition_that_the_user_wrote():
    m = move(relay.build(), 3, 2)
    elements = pyo.TransformationFactory('fesd.finite_elements')
    named = {data.name for pair in grid(m).cross.values() for data in elements.get_src_complementarity(pair)}
    assert named == {m.relay[t].name for t in m.t if t != 0}
    assert not any(c.active for c in m.relay.values())


def test_families_bear_the_name_of_the_condition():
    assert list(grid(move(relay.build(), 3, 2)).condition) == ['relay.complementarity[lower]', 'relay.complementarity[upper]']


def test_create_using_leaves_the_original_as_it_was():
    m = relay.build()
    before = seen(m)
    copy = pyo.TransformationFactory('fesd.finite_elements').create_using(m, nfe=5, ncp=2)
    assert seen(m) == before
    slides(solve(copy))


def test_a_clone_goes_its_own_way():
    m = move(relay.build(), 5, 2)
    copy = m.clone()
    slides(solve(copy))
    assert m.x[2].value == -2
    slides(solve(m))


def test_indices_beside_time_are_split_one_by_one():
    m = pyo.ConcreteModel()
    m.t, m.i = dae.ContinuousSet(bounds=(0, 2)), pyo.Set(initialize=['a', 'b'])
    start = {'a': -2.0, 'b': -1.0}
    m.x = pyo.Var(m.i, m.t, initialize=lambda m, i, t: start[i])
    m.z = pyo.Var(m.t, m.i, bounds=(0, 1), initialize=0.5)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i in m.i:
        m.x[i, 0].fix()
    m.ode = pyo.Constraint(m.i, m.t, rule=lambda m, i, t: m.dx[i, t] == 3 - 4 * m.z[t, i])
    m.relay = Complementarity(m.i, m.t, rule=lambda m, i, t: complements(m.z[t, i], -m.x[i, t]))
    solve(move(m, 9, 2))
    assert [(s.disjunction, round(s.time, 9)) for s in pyomo_fesd.switches(m)] == [
        ('relay[b]', round(1 / 3, 9)),
        ('relay[a]', round(2 / 3, 9)),
    ]


# Gauss


def test_with_gauss_an_objective_at_the_end_cannot_choose_the_position():
    m = relay.build()
    m.cost = pyo.Objective(expr=-m.z[2])
    slides(solve(move(m, 5, 2, scheme=LEGENDRE)))


def test_with_gauss_an_objective_at_the_end_cannot_choose_the_force_of_a_wall():
    m = walls.build()
    m.cost = pyo.Objective(expr=m.dx[3] - m.f[3])
    solve(move(m, 9, 2, scheme=LEGENDRE, piecewise_constant=[m.f]))
    assert pyo.value(m.cost) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize('curved', [False, True])
def test_gauss_is_warned_of_by_the_users_name_where_the_surface_is_curved(curved, caplog):
    m = relay.build()
    m.del_component(m.relay)
    m.h = pyo.Var(m.t, initialize=1)
    m.height = pyo.Constraint(m.t, rule=lambda m, t: m.h[t] == (m.x[t] ** 3 if curved else 2 * m.x[t]))
    m.valve = Complementarity(m.t, rule=lambda m, t: complements(m.z[t], -m.h[t]))
    move(m, 4, 2, scheme=LEGENDRE)
    assert [r.message.split(':')[0] for r in caplog.records if 'curved' in r.message] == ['valve.split'] * curved


# Reports


def test_a_trajectory_tells_where_each_condition_stands():
    m = solve(move(relay.build(), 5, 2))
    frame = pyomo_fesd.trajectory(m)
    names = [f'relay: {place}' for place in ('at lower bound', 'between', 'at upper bound')]
    assert list(frame.columns[-3:]) == names
    sliding = frame.index > relay.SWITCH + 1e-6
    assert frame[names[1]].tolist() == sliding.astype(float).tolist()
    assert (frame[names].sum(axis=1) == 1).all()


def test_on_a_fixed_grid_the_places_are_told_too():
    m = relay.build(discretise=collocate)
    solve(m)
    found = pyomo_fesd.switches(m)
    assert found[0].before == 'at lower bound' and found[-1].after == 'between'
    assert 'relay: between' in pyomo_fesd.trajectory(m)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_place_is_told_where_both_sides_are_zero_at_the_only_point_of_an_element(scheme):
    # w = max(0, x) as 0 <= w <= 9 perp w - x: with one Radau point, the switch is the only point of the element before it
    m = relay.plant(-1.0)
    m.del_component(m.ode)
    m.w = pyo.Var(m.t, bounds=(0, 9), initialize=0)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == 1)
    m.z.fix(0)
    m.positive = Complementarity(m.t, rule=lambda m, t: complements(m.w[t], m.w[t] - m.x[t]))
    solve(move(m, 2, 1, scheme=scheme, continuous=[m.w]))
    (switch,) = pyomo_fesd.switches(m)
    assert (switch.before, switch.after) == ('at lower bound', 'between')
    assert switch.time == pytest.approx(1, abs=1e-9)
