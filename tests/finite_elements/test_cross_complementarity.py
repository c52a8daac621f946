"""Cross complementarity: one active set in each element (theory, eq. 11)."""

import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd.core import all_hints
from pyomo_fesd.core.complementarity import read_complementarity
from pyomo_fesd.core.time_index import TimeIndex
from tests.models import dcs
from tests.problems import relay_of_states, setpoint, sliding, weir
from tests.problems.forms_of import form_block
from tests.problems.running import EXACT_SCHEMES, LEGENDRE, RADAU, SCHEMES, move, run, solve, transform

FORMS = ('element', 'point', 'full')


def block(m):
    """The block of the only moving grid."""
    return m.component('_pyomo_fesd_elements_t')


def labels_of(expr, component):
    """Time labels at which a component takes part in an expression."""
    return sorted(v.index() for v in identify_variables(expr) if v.parent_component() is component)


# The user's own complementarity


@pytest.mark.parametrize('cross', FORMS)
@pytest.mark.parametrize('slack_first', [True, False], ids=['slack first', 'outflow first'])
@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_a_weir_flows_over_at_its_time(scheme, ncp, slack_first, cross):
    m = solve(move(weir.build(slack_first=slack_first), 5, ncp, scheme=scheme, cross_complementarity=cross))
    times = pyomo_fesd.physical_time(m)
    boundaries = [times[label] for label in m.t.get_finite_elements()]
    assert min(abs(t - weir.SWITCH) for t in boundaries) <= 1e-8
    for t, now in times.items():
        assert m.V[t].value == pytest.approx(min(now, weir.V_MAX), abs=1e-8)
        if t != 0:
            assert m.F[t].value == pytest.approx(weir.OVERFLOW if now > weir.SWITCH + 1e-8 else 0, abs=1e-8)


@pytest.mark.parametrize('slack_first', [True, False], ids=['slack first', 'outflow first'])
@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_a_weir_whose_level_is_an_algebraic_variable_flows_over_at_its_time(scheme, ncp, slack_first):
    m = weir.build(level='algebraic', slack_first=slack_first)
    solve(move(m, 5, ncp, scheme=scheme))
    times = pyomo_fesd.physical_time(m)
    for t, now in times.items():
        assert m.V[t].value == pytest.approx(min(now, weir.V_MAX), abs=1e-8)


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_a_weir_whose_level_follows_from_coupled_equations_is_right_or_warned_of(scheme, ncp, caplog):
    m = move(weir.build(level='coupled'), 5, ncp, scheme=scheme)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    if not pyo.check_optimal_termination(results) or any('overflow' in r.message for r in caplog.records):
        return
    for t, now in pyomo_fesd.physical_time(m).items():
        assert m.V[t].value == pytest.approx(min(now, weir.V_MAX), abs=1e-8)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_two_weirs_in_series_flow_over_one_after_the_other(scheme):
    m = solve(move(weir.build_series(), 9, 2, scheme=scheme))
    assert m.V[2, 1].value == pytest.approx(weir.V_MAX, abs=1e-8)
    assert m.V[2, 2].value == pytest.approx(0.5, abs=1e-8)
    times = pyomo_fesd.physical_time(m)
    boundaries = [times[label] for label in m.t.get_finite_elements()]
    for switch in weir.SWITCHES:
        assert min(abs(t - switch) for t in boundaries) <= 1e-8


@pytest.mark.parametrize('cross', FORMS)
@pytest.mark.parametrize('scheme', SCHEMES)
def test_two_states_that_are_complementary_themselves_switch_at_their_time(scheme, cross):
    m = solve(move(relay_of_states.build(), 3, 2, scheme=scheme, cross_complementarity=cross))
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(relay_of_states.SWITCH, abs=1e-9)
    assert m.x[2].value == pytest.approx(relay_of_states.FINAL, abs=1e-9)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_a_weir_in_a_block_over_time_flows_over_at_its_time(scheme):
    m = weir.build()
    m.del_component(m.overflow)

    @m.Block(m.t)
    def crest(b, t):
        b.overflow = Complementarity(expr=complements(weir.V_MAX - m.V[t] >= 0, m.F[t] >= 0))

    solve(move(m, 5, 2, scheme=scheme))
    assert list(block(m).condition) == ['crest.overflow']
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(weir.SWITCH, abs=1e-8)


def test_a_weir_may_have_a_mutable_param_as_its_height():
    m = weir.build()
    m.del_component(m.overflow)
    m.height = pyo.Param(initialize=weir.V_MAX, mutable=True)
    m.overflow = Complementarity(m.t, rule=lambda m, t: complements(m.V[t] <= m.height, m.F[t] >= 0))
    solve(move(m, 5, 2))
    assert m.V[2].value == pytest.approx(weir.V_MAX, abs=1e-9)
    m.height = 0.9
    solve(m)
    assert m.V[2].value == pytest.approx(0.9, abs=1e-9)


def test_a_condition_that_skips_the_first_time_is_aggregated_without_it():
    m = solve(move(weir.build(first_time=False), 5, 2))
    assert m.V[2].value == pytest.approx(weir.V_MAX, abs=1e-9)
    times = pyomo_fesd.physical_time(m)
    assert min(abs(times[label] - weir.SWITCH) for label in m.t.get_finite_elements()) <= 1e-9


def test_a_condition_on_one_part_of_the_time_leaves_the_other_elements_alone():
    m = weir.build()
    m.del_component(m.overflow)
    m.overflow = Complementarity(
        m.t,
        rule=lambda m, t: Complementarity.Skip if t <= 1 else complements(weir.V_MAX - m.V[t] >= 0, m.F[t] >= 0),
    )
    move(m, 4, 1)
    assert list(block(m).cross) == [('overflow', 3), ('overflow', 4)]


def test_a_condition_without_time_stays_as_it_is():
    m = dcs(signum.build())
    m.y, m.z = pyo.Var(bounds=(0, None), initialize=1), pyo.Var(bounds=(0, None), initialize=1)
    m.either = Complementarity(expr=complements(m.y >= 0, m.z >= 0))
    m.cost = pyo.Objective(expr=(m.y - 2) ** 2 + (m.z - 1) ** 2)
    solve(move(m, 10))
    assert m.either.active
    assert (m.y.value, m.z.value) == pytest.approx((2, 0), abs=1e-6)


def test_a_condition_that_is_switched_off_at_some_times_takes_no_part_there():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.V, m.F = pyo.Var(m.t), pyo.Var(m.t, bounds=(0, None))
    m.dV = dae.DerivativeVar(m.V)
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=4, ncp=1)
    m.overflow = Complementarity(m.t, rule=lambda m, t: complements(weir.V_MAX - m.V[t] >= 0, m.F[t] >= 0))
    m.overflow[1.0].deactivate()
    move(m)
    assert list(block(m).cross) == [('overflow', 1), ('overflow', 3), ('overflow', 4)]


# Which points take part


@pytest.mark.parametrize('scheme', SCHEMES)
def test_the_multiplier_at_the_left_boundary_takes_part(scheme):
    m = transform(signum.build(), 2, 2, scheme=scheme)
    modes = m.component('_pyomo_fesd_dcs').sgn
    labels = list(m.t)
    for index, pair in block(m).cross.items():
        name, n = index
        nu_side, lam_side = read_complementarity(pair)
        lam = modes.n if name.endswith('[1]') else modes.p
        first = 1 if n == 1 else len(labels) // 2 + 1
        stages = labels[first : first + 2]
        end = [] if scheme == RADAU else [labels[first + 2]]
        assert labels_of(nu_side, modes.alpha) == stages
        assert labels_of(lam_side, lam) == [labels[first - 1], *stages, *end]


def test_a_multiplier_that_jumps_with_a_control_does_not_reach_into_the_next_stage():
    smooth, held = setpoint.build(), setpoint.build()
    transform(smooth, 4, 1)
    transform(held, 4, 1, piecewise_constant=[held.u])
    for m, expected in ((smooth, [1, 1.5]), (held, [1.5])):
        p = m.component('_pyomo_fesd_dcs').regulator.p
        pair = block(m).cross['regulator.complementarity[2]', 3]
        assert labels_of(read_complementarity(pair).H, p) == expected


def test_of_several_switching_functions_only_those_with_a_held_control_jump_at_stages():
    m = setpoint.build()
    del m.regulator, m.regulator_disjuncts
    m.regulator = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] <= 5, m.dx[t] == 1],
            [m.x[t] >= 5, m.x[t] <= m.u[t], m.dx[t] == 2],
            [m.x[t] >= 5, m.x[t] >= m.u[t], m.dx[t] == 3],
        ],
    )
    transform(m, 4, 1, form='heaviside', piecewise_constant=[m.u])
    p = form_block(m)[1].p
    for function, expected in ((1, [(1, 1), (1.5, 1)]), (2, [(1.5, 2)])):
        pair = block(m).cross[f'regulator.complementarity[{function},2]', 3]
        assert labels_of(read_complementarity(pair).H, p) == expected


@pytest.mark.parametrize('cross, pairs', [('auto', 1), ('element', 1), ('point', 3), ('full', 3 * 4)])
def test_pairs_an_element_with_radau(cross, pairs):
    m = transform(signum.build(), 5, 3, cross_complementarity=cross)
    assert len(block(m).cross) == 2 * 5 * pairs


@pytest.mark.parametrize('cross, pairs', [('element', 1), ('point', 3), ('full', 3 * 5)])
def test_pairs_an_element_with_gauss(cross, pairs):
    m = transform(signum.build(), 5, 3, scheme=LEGENDRE, cross_complementarity=cross)
    assert len(block(m).cross) == 2 * 5 * pairs


@pytest.mark.parametrize('build', [signum.build, weir.build])
def test_the_sources_are_switched_off_except_at_the_first_time(build):
    m = build()
    move(dcs(m) if build is signum.build else m, 3)
    times = TimeIndex(m.t)
    own = [c for c in m.component_data_objects(Complementarity) if '_elements_' not in c.name]
    assert {times.time(c) for c in own if c.active} == {0}
    assert {times.time(c) for c in own if not c.active} == set(m.t) - {0}


def test_families_are_named_as_the_user_named_them():
    m = weir.build_series()
    move(m, 3)
    assert list(block(m).condition) == ['overflow[1]', 'overflow[2]']


# Signs


def test_sides_whose_bounds_say_their_sign_get_no_inequality():
    m = transform(signum.build(), 3)
    assert len(block(m).nonnegative) == 0


def test_sides_whose_bounds_do_not_say_their_sign_get_one_at_each_time():
    m = move(weir.build(), 3)
    texts = sorted(str(c.expr) for c in block(m).nonnegative.values())
    assert texts == sorted(f'0  <=  0.7 - V[{t}]' for t in m.t)


def test_sides_get_no_inequality_at_the_times_at_which_bounds_say_their_sign():
    m = weir.build()
    given = list(m.t)
    for t in given:
        m.V[t].setub(0.7)
    texts = [str(c.expr) for c in block(move(m, 3)).nonnegative.values()]
    assert sorted(texts) == sorted(f'0  <=  0.7 - V[{t}]' for t in m.t if t not in given)


@pytest.mark.parametrize('low', [0.7, 0.6])
def test_a_bound_that_may_change_does_not_say_the_sign_of_a_side(low):
    m = weir.build()
    m.top = pyo.Param(mutable=True, initialize=low)
    for t in m.t:
        m.V[t].setub(m.top)
    assert len(block(move(m, 3)).nonnegative) == len(m.t)


@pytest.mark.parametrize('scheme', SCHEMES)
def test_no_side_is_negative_anywhere(scheme):
    m = solve(move(weir.build(), 5, 3, scheme=scheme))
    assert min(v.value for v in m.F.values()) >= -1e-9
    assert max(v.value for v in m.V.values()) <= weir.V_MAX + 1e-9


# Gauss


def test_with_gauss_the_copy_at_a_boundary_keeps_the_value_of_the_last_stage():
    m = run(signum.build(), 5, 3, scheme=LEGENDRE)
    frame = pyomo_fesd.trajectory(m)
    for label in list(m.t.get_finite_elements())[1:]:
        end = frame[frame['label'] == label].iloc[0]
        before = frame[(frame['element'] == end['element']) & (frame['label'] < label)].iloc[-1]
        assert end['sgn: below'] == pytest.approx(before['sgn: below'], abs=1e-9)


def test_with_gauss_an_objective_at_the_end_cannot_choose_its_outflow():
    m = weir.build(slack_first=False)
    m.cost = pyo.Objective(expr=(m.F[2] - 7) ** 2)
    solve(move(m, 5, 2, scheme=LEGENDRE))
    assert m.F[2].value == pytest.approx(weir.OVERFLOW, abs=1e-6)


def test_with_radau_nothing_needs_to_be_held():
    assert block(transform(signum.build(), 3)).component('left_limit') is None


def test_gauss_on_a_curved_surface_is_named_once(caplog):
    transform(oscillator.build(), 4, 2, scheme=LEGENDRE)
    (record,) = [r for r in caplog.records if 'curved' in r.message]
    assert record.levelname == 'WARNING' and record.name == 'pyomo_fesd'
    assert record.message.startswith('circle') and 'LAGRANGE-RADAU' in record.message


@pytest.mark.parametrize('build, scheme', [(oscillator.build, RADAU), (signum.build, LEGENDRE), (signum.build, RADAU)])
def test_radau_and_plane_surfaces_are_not_warned_of(build, scheme, caplog):
    transform(build(), 4, 2, scheme=scheme)
    assert not [r for r in caplog.records if 'curved' in r.message]


def test_gauss_on_a_curved_slide_is_never_answered_wrongly(caplog):
    m = transform(sliding.build_curved(), 4, 2, scheme=LEGENDRE)
    assert any('curved' in r.message for r in caplog.records)
    if pyo.check_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m)):
        assert m.x[0.45].value == pytest.approx(sliding.CURVED['x'], abs=1e-6)


@pytest.mark.parametrize('ncp', [1, 2, 3])
def test_gauss_crosses_a_curved_surface(ncp):
    m = run(oscillator.build(), 20, ncp, scheme=LEGENDRE)
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(oscillator.SWITCH, abs={1: 1e-1, 2: 1e-3, 3: 1e-5}[ncp])


# The first time


def started_on_the_surface(goal, cross, form, **keywords):
    """dx/dt = 3 below 0 and 1 above, simulated from x = 0, where nu at the first time is free; then x(0) is free too."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 1))
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.d = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 3], [m.x[t] >= 0, m.dx[t] == 1]])
    m.cost = pyo.Objective(expr=(m.x[1] - goal) ** 2)
    move(dcs(m, form=form), 4, 2, cross_complementarity=cross, **keywords)
    m.x[0].fix(0)
    pyomo_fesd.simulate(m)
    m.x[0].unfix()
    return m


@pytest.mark.parametrize('scheme', [RADAU, LEGENDRE])
@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize('cross', FORMS)
def test_a_start_on_the_surface_is_not_tied_to_it(cross, form, scheme):
    m = started_on_the_surface(1.5, cross, form, scheme=scheme)
    # x(1) = 1 + x(0) for x(0) > 0
    assert not pyomo_fesd.certify(m).certified
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B' and pyo.value(m.cost) <= 1e-9
    assert m.x[0].value == pytest.approx(0.5, abs=1e-6)


def test_parts_of_mixed_conditions_do_not_follow():
    m = move(weir.build(), 5, 2)
    assert not all_hints(m).followers
    m = started_on_the_surface(1.5, 'element', 'heaviside')
    assert [f.leader for f in all_hints(m).followers] == [pair for (_, n), pair in block(m).cross.items() if n == 1]
