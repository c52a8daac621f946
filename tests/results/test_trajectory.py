"""Results on physical time: labels, trajectories and switches."""

import bouncing_ball
import gas_liquid_tank
import numpy as np
import pandas as pd
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
import signum
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity, complements

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.results.switches import Switch, Switches
from tests.models import dcs
from tests.problems import air_friction, crossing, free_start, relay_of_states, sliding, two_systems, weir
from tests.problems.running import EXACT_SCHEMES, LEGENDRE, RADAU, move, run, solve, transform


@pytest.fixture(scope='module')
def solved():
    """Signum, ten Radau elements of two points."""
    return run(signum.build(), nfe=10, ncp=2)


@pytest.fixture(scope='module')
def tank():
    """The tank in blocks, 20 Radau elements of three points."""
    return run(gas_liquid_tank.build_in_blocks(), nfe=20, ncp=3)


def states(points=(0, 2)):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    m.x = pyo.Var(m.t, initialize=lambda m, t: 3 * t - 2)
    m.dx = dae.DerivativeVar(m.x)
    return m


GRIDS = {
    'not discretised': lambda m: m,
    'Radau': lambda m: grid(m, 'dae.collocation', nfe=4, ncp=2),
    'Legendre': lambda m: grid(m, 'dae.collocation', nfe=4, ncp=2, scheme=LEGENDRE),
    'backward': lambda m: grid(m, 'dae.finite_difference', nfe=4, scheme='BACKWARD'),
    'central': lambda m: grid(m, 'dae.finite_difference', nfe=4, scheme='CENTRAL'),
    'forward': lambda m: grid(m, 'dae.finite_difference', nfe=4, scheme='FORWARD'),
}


def grid(m, transformation, **keywords):
    pyo.TransformationFactory(transformation).apply_to(m, wrt=m.t, **keywords)
    return m


# Physical time


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_physical_time_increases_from_the_first_label_to_the_last(scheme, ncp):
    m = run(signum.build(), nfe=10, ncp=ncp, scheme=scheme)
    times = pyomo_fesd.physical_time(m, m.t)
    assert list(times) == list(m.t)
    assert min(np.diff(list(times.values()))) > 0
    assert (times[0], times[2]) == pytest.approx((0, 2), abs=1e-10)


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_physical_time_is_that_at_which_the_state_has_its_value(scheme, ncp):
    m = run(signum.build(), nfe=10, ncp=ncp, scheme=scheme)
    for label, time in pyomo_fesd.physical_time(m).items():
        assert m.x[label].value == pytest.approx(3 * time - 2 if time < 2 / 3 else time - 2 / 3, abs=1e-9)


@pytest.mark.parametrize('kind', GRIDS)
def test_on_an_ordinary_grid_labels_are_physical_time(kind):
    m = GRIDS[kind](states((5, 6, 9)))
    assert pyomo_fesd.physical_time(m) == {t: float(t) for t in m.t}


def test_before_a_solve_moving_labels_are_at_their_nominal_time():
    m = transform(signum.build(), nfe=5)
    for label, time in pyomo_fesd.physical_time(m).items():
        assert time == pytest.approx(label, abs=1e-6)


@pytest.mark.parametrize('kind', ['Radau', 'Legendre', 'backward'])
def test_elements_of_an_ordinary_grid_have_their_nominal_lengths(kind):
    elements = pyomo_fesd.element_lengths(GRIDS[kind](states()))
    assert list(elements.index) == [1, 2, 3, 4] and elements.index.name == 'element'
    assert elements['length'].tolist() == pytest.approx([0.5] * 4)
    assert elements['start'].tolist() == pytest.approx([0, 0.5, 1, 1.5])


def test_elements_follow_one_another(solved):
    elements = pyomo_fesd.element_lengths(solved, solved.t)
    assert elements['start'].tolist()[1:] == elements['end'].tolist()[:-1]
    assert elements['length'].tolist() == pytest.approx((elements['end'] - elements['start']).tolist())
    assert min(abs(elements['end'] - 2 / 3)) <= 1e-9


def test_a_question_about_no_continuous_set_is_refused():
    m = pyo.ConcreteModel()
    m.x = pyo.Var()
    for ask in (pyomo_fesd.physical_time, pyomo_fesd.trajectory, pyomo_fesd.switches, pyomo_fesd.element_lengths):
        with pytest.raises(FesdError, match=f'{ask.__name__}: the model has no ContinuousSet'):
            ask(m)
        with pytest.raises(FesdError, match="'wrt' must be a pyomo.dae.ContinuousSet"):
            ask(m, m.x)


# Trajectories


def test_a_trajectory_has_states_derivatives_and_multipliers_by_name(solved):
    frame = pyomo_fesd.trajectory(solved)
    assert list(frame.columns) == ['label', 'element', 'x', 'dx', 'sgn: below', 'sgn: above']
    assert frame.index.name == 'time'
    assert frame['label'].tolist() == list(solved.t)
    assert frame.index.tolist() == list(pyomo_fesd.physical_time(solved).values())
    assert frame['x'].tolist() == [solved.x[t].value for t in solved.t]


def test_multipliers_are_one_where_the_mode_is_active_and_add_up_to_one(solved):
    frame = pyomo_fesd.trajectory(solved)
    below, above = frame['sgn: below'], frame['sgn: above']
    assert (below + above).tolist() == pytest.approx([1] * len(frame))
    assert below[frame.index < 2 / 3 - 1e-6].tolist() == pytest.approx([1] * int(sum(frame.index < 2 / 3 - 1e-6)))
    assert below[frame.index > 2 / 3 + 1e-6].tolist() == pytest.approx([0] * int(sum(frame.index > 2 / 3 + 1e-6)))


@pytest.mark.parametrize('form', ['auto', 'stewart', 'heaviside'])
def test_multipliers_are_shown_in_every_form(form):
    frame = pyomo_fesd.trajectory(run(sliding.build(), nfe=5, form=form))
    last = frame.iloc[-1]
    assert (last['friction: rising'], last['friction: falling']) == pytest.approx((0.5, 0.5), abs=1e-8)


@pytest.mark.parametrize('scheme, points', [(RADAU, 2), (LEGENDRE, 3)])
def test_element_tells_where_a_row_comes_from(scheme, points):
    frame = pyomo_fesd.trajectory(transform(signum.build(), nfe=3, ncp=2, scheme=scheme))
    assert frame['element'].tolist() == [1] + [n for n in (1, 2, 3) for _ in range(points)]


def test_element_is_told_for_a_backward_difference_too():
    m = move(dcs(free_start.build(-2, discretise=GRIDS['backward'])))
    assert pyomo_fesd.trajectory(m)['element'].tolist() == [1, 1, 2, 3, 4]


def test_names_are_those_of_the_model_without_time(tank):
    frame = pyomo_fesd.trajectory(tank)
    assert {'M_G', 'M_L', 'P', 'L', 'G', 'pipe.outlet: liquid', 'pipe.outlet: gas'} <= set(frame.columns)
    assert frame['P'].iloc[-1] == pytest.approx(gas_liquid_tank.EXACT['P'], rel=1e-7)
    assert not [c for c in frame.columns if '_pyomo_fesd' in c or '*' in c]


def test_further_indices_stay_in_the_name():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, 1])
    m.F = pyo.Var(['a', 'b'], m.t, [1, 2], initialize=lambda m, i, t, k: {'a': 10, 'b': 20}[i] + k + t)
    m.unit = pyo.Block(['u'])
    m.unit['u'].y = pyo.Var(m.t, initialize=7)
    frame = pyomo_fesd.trajectory(m)
    assert list(frame.columns[2:]) == ['F[a,1]', 'F[a,2]', 'F[b,1]', 'F[b,2]', 'unit[u].y']
    assert frame['F[b,2]'].tolist() == [22, 23]


def test_named_expressions_are_shown_too():
    frame = pyomo_fesd.trajectory(run(gas_liquid_tank.build_eliminated(), nfe=10))
    assert frame['P'].iloc[-1] == pytest.approx(gas_liquid_tank.EXACT['P'], rel=1e-3)


def test_variables_and_expressions_without_time_are_no_trajectories():
    m = states()
    m.volume = pyo.Var(initialize=1)
    m.double = pyo.Expression(expr=2 * m.volume)
    m.view = pyo.Reference(m.x)
    assert list(pyomo_fesd.trajectory(m).columns[2:]) == ['x']


def test_what_has_no_value_is_nan():
    m = states()
    m.y = pyo.Var(m.t)
    m.y[0].value = 1
    m.z = pyo.Var(m.t, initialize=3)
    del m.z[2]
    m.inverse = pyo.Expression(m.t, rule=lambda m, t: 1 / m.y[t])
    frame = pyomo_fesd.trajectory(m)
    for name in ('y', 'z', 'inverse'):
        assert np.isnan(frame[name].iloc[1]) and not np.isnan(frame[name].iloc[0]), name


def test_an_expression_that_cannot_be_evaluated_is_nan():
    m = states()
    m.y = pyo.Var(m.t, initialize=lambda m, t: t)
    m.inverse = pyo.Expression(m.t, rule=lambda m, t: 1 / m.y[t])
    m.logarithm = pyo.Expression(m.t, rule=lambda m, t: pyo.log(m.y[t] - 1))
    m.root = pyo.Expression(m.t, rule=lambda m, t: (m.y[t] - 1) ** 0.5)
    frame = pyomo_fesd.trajectory(m)
    assert np.isnan(frame['inverse'].iloc[0]) and frame['inverse'].iloc[1] == 0.5
    assert np.isnan(frame['logarithm'].iloc[0]) and frame['logarithm'].iloc[1] == 0
    assert np.isnan(frame['root'].iloc[0]) and frame['root'].iloc[1] == 1


@pytest.mark.parametrize('kind', GRIDS)
def test_a_trajectory_of_an_ordinary_model_is_its_values_by_label(kind):
    m = GRIDS[kind](states())
    for t in m.t:
        m.x[t].value = 3 * t - 2
    frame = pyomo_fesd.trajectory(m)
    assert frame['label'].tolist() == list(m.t)
    assert frame['x'].tolist() == pytest.approx([3 * t - 2 for t in m.t])


# Switches


def test_a_switch_tells_its_time_and_the_modes_before_and_after(solved):
    (switch,) = pyomo_fesd.switches(solved)
    assert switch.time == pytest.approx(2 / 3, abs=1e-9)
    assert switch[1:] == ('sgn', 'below', 'above')
    assert str(switch) == 'time 0.6666666667: sgn  below -> above'


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
def test_a_slide_is_told_with_the_modes_that_take_part(scheme, ncp):
    (switch,) = pyomo_fesd.switches(run(sliding.build(), nfe=5, ncp=ncp, scheme=scheme))
    assert (switch.before, switch.after) == ('rising', 'sliding rising | falling')


def test_a_slide_in_a_block_is_told_with_the_name_of_the_block(tank):
    (switch,) = pyomo_fesd.switches(tank)
    assert switch[1:] == ('pipe.outlet', 'liquid', 'sliding liquid | gas')
    assert switch.time == pytest.approx(gas_liquid_tank.EXACT['t_s'], rel=1e-8)


def test_modes_written_as_expressions_are_called_by_their_number():
    (switch,) = pyomo_fesd.switches(run(crossing.build(), nfe=5))
    assert switch[1:] == ('zero', 'mode 1', 'mode 2')


def test_modes_of_one_indexed_disjunct_are_told_apart():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.side = pyo.Set(initialize=['below', 'above'])
    m.x = pyo.Var(m.t, initialize=-2)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(-2)

    @m.Disjunct(m.t, m.side)
    def mode(d, t, side):
        d.region = pyo.Constraint(expr=m.x[t] <= 0 if side == 'below' else m.x[t] >= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == (3 if side == 'below' else 1))

    m.sgn = Disjunction(m.t, rule=lambda m, t: [m.mode[t, side] for side in m.side])
    run(m, nfe=10)
    (switch,) = pyomo_fesd.switches(m)
    assert (switch.before, switch.after) == ('mode[below]', 'mode[above]')
    assert list(pyomo_fesd.trajectory(m).columns[-2:]) == ['sgn: mode[below]', 'sgn: mode[above]']


def test_several_disjunctions_are_told_in_order_of_time():
    found = pyomo_fesd.switches(run(two_systems.build(), nfe=8))
    assert [s.disjunction for s in found] == [name for _, name in two_systems.SWITCHES]
    assert [s.time for s in found] == pytest.approx([time for time, _ in two_systems.SWITCHES], abs=1e-8)


@pytest.mark.parametrize('scheme, ncp', EXACT_SCHEMES)
@pytest.mark.parametrize('slack_first', [True, False])
def test_a_condition_of_the_users_own_is_told_as_one_switch(scheme, ncp, slack_first):
    found = pyomo_fesd.switches(solve(move(weir.build(slack_first=slack_first), 5, ncp, scheme=scheme)))
    sides = ('G > 0', 'H > 0') if slack_first else ('H > 0', 'G > 0')
    assert [(s.disjunction, s.before, s.after) for s in found] == [('overflow', *sides)]
    assert found[0].time == pytest.approx(weir.SWITCH, abs=1e-8)


def test_a_condition_that_skips_the_first_time_is_told_too():
    m = solve(move(weir.build(first_time=False), 5, 2))
    (switch,) = pyomo_fesd.switches(m)
    assert switch.time == pytest.approx(weir.SWITCH, abs=1e-8)


def test_conditions_with_further_indices_are_told_one_by_one():
    found = pyomo_fesd.switches(solve(move(weir.build_series(), 9, 2)))
    assert [s.disjunction for s in found] == ['overflow[1]', 'overflow[2]']
    assert [s.time for s in found] == pytest.approx(weir.SWITCHES, abs=1e-8)


def test_a_model_that_never_switches_says_so():
    found = pyomo_fesd.switches(run(free_start.build(-8), nfe=3))
    assert found == [] and str(found) == repr(found) == 'no switch'


@pytest.mark.parametrize('kind', ['Radau', 'Legendre', 'backward'])
def test_an_ordinary_model_without_modes_has_no_switch(kind):
    assert str(pyomo_fesd.switches(GRIDS[kind](states()))) == 'no switch'


@pytest.mark.parametrize(
    'kind, cause',
    [('not discretised', 'not discretised yet'), ('central', 'CENTRAL Difference'), ('forward', 'FORWARD Difference')],
)
def test_questions_about_elements_are_refused_where_there_are_none(kind, cause):
    m = GRIDS[kind](states())
    for ask in (pyomo_fesd.switches, pyomo_fesd.element_lengths):
        with pytest.raises(FesdError, match=f'^t: .*{cause}'):
            ask(m)


def test_on_a_fixed_grid_the_element_with_the_switch_is_told_as_sliding():
    m = free_start.build(-2, discretise=lambda m: grid(m, 'dae.collocation', nfe=10, ncp=2))
    solve(dcs(m))
    found = pyomo_fesd.switches(m)
    assert (found[0].before, found[-1].after) == ('mode 1', 'mode 2')
    assert all(0.5 <= s.time <= 0.9 for s in found)


def test_mixed_conditions_on_a_fixed_grid_are_no_obstacle():
    m = grid(states(), 'dae.collocation', nfe=4, ncp=2)
    m.z = pyo.Var(m.t, initialize=0)
    m.clip = Complementarity(m.t, rule=lambda m, t: complements(pyo.inequality(0, m.z[t], 1), m.x[t] - 5))
    assert isinstance(pyomo_fesd.switches(m), Switches)


def test_conditions_that_are_switched_off_are_not_told():
    m = grid(states(), 'dae.collocation', nfe=4, ncp=1)
    m.F = pyo.Var(m.t, initialize=lambda m, t: float(t > 1))
    m.wall = Complementarity(m.t, rule=lambda m, t: complements(m.F[t] >= 0, 1 - m.F[t] >= 0))
    assert len(pyomo_fesd.switches(m)) == 1
    m.wall.deactivate()
    assert pyomo_fesd.switches(m) == []


def test_switches_print_one_a_line_and_make_a_table():
    found = Switches([Switch(0.5, 'a', 'x', 'y'), Switch(1 / 3, 'b', 'u', 'sliding u | v')])
    assert str(found) == repr(found) == 'time 0.5: a  x -> y\ntime 0.3333333333: b  u -> sliding u | v'
    frame = pd.DataFrame(found)
    assert list(frame.columns) == ['time', 'disjunction', 'before', 'after']
    assert frame['before'].tolist() == ['x', 'u']


def test_two_states_that_are_complementary_switch_once():
    found = pyomo_fesd.switches(solve(move(relay_of_states.build(), 3, 2)))
    assert [s[1:] for s in found] == [('either', 'H > 0', 'G > 0')]


# State jumps


@pytest.fixture(scope='module')
def ball():
    """The bouncing ball, ten Radau elements of two points."""
    m = move(bouncing_ball.build(), 10, 2)
    pyomo_fesd.simulate(m)
    return m


def test_where_a_state_jumps_there_are_two_rows(ball):
    frame = pyomo_fesd.trajectory(ball)
    assert len(frame) == len(ball.t) + 4
    assert frame.index.is_monotonic_increasing
    doubled = frame[frame.index.duplicated(keep=False)]
    assert sorted(set(doubled.index)) == pytest.approx(bouncing_ball.impacts(), abs=1e-7)
    before, after = doubled.iloc[0], doubled.iloc[1]
    assert (before['q'], after['q']) == pytest.approx((0, 0), abs=1e-7)
    assert after['v'] == pytest.approx(-before['v']) and after['v'] > 0
    assert (before['label'], before['element'] + 1) == (after['label'], after['element'])


def test_after_a_jump_only_the_states_are_told(ball):
    frame = pyomo_fesd.trajectory(ball)
    after = frame[frame.index.duplicated()]
    assert after[['dq', 'dv', 'impact.guard']].isna().all(axis=None)
    assert not frame[~frame.index.duplicated()].isna().any(axis=None)
    assert frame['element'].dtype == int


def test_a_state_that_does_not_jump_keeps_its_value_and_its_unit_may_be_called_label():
    m = bouncing_ball.build()
    m.label = pyo.Var(m.t, initialize=5)
    m.dlabel = dae.DerivativeVar(m.label)
    m.label[0].fix(5)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dlabel[t] == 0)
    move(m, 10, 2)
    frame = pyomo_fesd.simulate(m)
    assert frame['label'].tolist() == pytest.approx([5] * len(frame))


def test_without_a_jump_there_is_one_row_a_time():
    m = move(bouncing_ball.build(1.0, 0.3), 3, 2)
    assert len(pyomo_fesd.simulate(m)) == len(m.t)


def test_jumps_are_told_in_order_of_time_among_the_switches():
    m = transform(air_friction.build(), 10, 2)
    pyomo_fesd.simulate(m)
    found = pyomo_fesd.switches(m)
    assert [s.disjunction for s in found] == ['drag', 'impact', 'drag', 'drag', 'impact', 'drag']
    assert [s.time for s in found] == sorted(s.time for s in found)


# Indicator variables


def test_after_a_solve_indicators_are_true_or_false_where_the_mode_is_clear(solved):
    times = pyomo_fesd.physical_time(solved)
    for t in solved.t:
        assert solved.below[t].indicator_var.value is (times[t] <= 2 / 3 + 1e-9)
        assert solved.above[t].indicator_var.value is (times[t] > 2 / 3 + 1e-9)


def test_after_a_solve_indicators_are_unset_in_a_slide():
    m = run(sliding.build(), nfe=5)
    times = pyomo_fesd.physical_time(m)
    for t in m.t:
        before = times[t] <= sliding.SWITCH + 1e-9
        assert m.rising[t].indicator_var.value is (True if before else None)
        assert m.falling[t].indicator_var.value is (False if before else None)


def test_indicators_in_blocks_are_set_too(tank):
    assert tank.pipe[0].liquid.indicator_var.value is True
    assert tank.pipe[20].gas.indicator_var.value is None
    assert all(isinstance(b.liquid, Disjunct) for b in tank.pipe.values())
