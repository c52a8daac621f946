"""Regions: inequalities in any writing become switching functions and sign patterns (theory, eq. 4)."""

from itertools import pairwise

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import (
    above,
    add_modes,
    below,
    dcs,
    form_of,
    generated,
    modes_on,
    quadrants,
    scalar_ode,
    snapshot,
    thresholds,
)
from tests.problems.forms_of import form_block
from tests.problems.running import move, solve

BELOW_1 = {
    'x <= 1': lambda x: x <= 1,
    '1 >= x': lambda x: 1 >= x,
    'x - 1 <= 0': lambda x: x - 1 <= 0,
    '0 <= 1 - x': lambda x: 0 <= 1 - x,
    '2 - 2*x >= 0': lambda x: 2 - 2 * x >= 0,
    '-x/1000 >= -1/1000': lambda x: -x / 1000 >= -0.001,
    '1e6*x <= 1e6': lambda x: 1e6 * x <= 1e6,
    '3*x - 2 <= 2*x - 1': lambda x: 3 * x - 2 <= 2 * x - 1,
    '(None, x, 1)': lambda x: (None, x, 1),
}
ABOVE_1 = {
    'x >= 1': lambda x: x >= 1,
    '7 - 7*x <= 0': lambda x: 7 - 7 * x <= 0,
    '(1, x, None)': lambda x: (1, x, None),
}


def two_modes(low, high, **keywords):
    """'low' and 'high' with regions ``low(m, t)`` and ``high(m, t)``."""
    m = scalar_ode(**keywords)

    @m.Disjunct(m.t)
    def low_mode(d, t):
        d.region = pyo.Constraint(expr=low(m, t))
        d.ode = pyo.Constraint(expr=m.dx[t] == 3)

    @m.Disjunct(m.t)
    def high_mode(d, t):
        d.region = pyo.Constraint(expr=high(m, t))
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunction(m.t)
    def sgn(m, t):
        return [m.low_mode[t], m.high_mode[t]]

    return m


def modes_at(m, *states, disjunction='sgn', tolerance=1e-7):
    """Numbers of the modes that can be on alone at each ``(x, y)``."""
    data = m.component(disjunction)[0]
    found = []
    for x, y in states:
        m.x[0].value, m.y[0].value = x, y
        on = modes_on(data, tolerance)
        found.append([i for i, d in enumerate(data.disjuncts) if any(d is o for o in on)])
    return found


@pytest.mark.parametrize('high', ABOVE_1)
@pytest.mark.parametrize('low', BELOW_1)
def test_one_switching_function_is_seen_however_the_inequalities_are_written(low, high):
    m = two_modes(lambda m, t: BELOW_1[low](m.x[t]), lambda m, t: ABOVE_1[high](m.x[t]))
    dcs(m)
    assert form_block(m)[0] == ''
    assert modes_at(m, (0.9, 0), (1.1, 0)) == [[0], [1]]


def test_a_nonlinear_surface_is_one_switching_function():
    m = two_modes(
        lambda m, t: m.x[t] ** 2 + m.y[t] ** 2 <= 4,
        lambda m, t: m.y[t] ** 2 / 2 >= (2 - m.x[t]) * (2 + m.x[t]) / 2,
    )
    dcs(m)
    assert form_block(m)[0] == ''
    assert modes_at(m, (1, 1), (-1, 1.5), (2, 1), (-1, -2)) == [[0], [0], [1], [1]]


def test_similar_surfaces_are_told_apart():
    m = two_modes(lambda m, t: m.x[t] + m.y[t] <= 1, lambda m, t: m.x[t] + 1.001 * m.y[t] >= 1)
    with pytest.raises(FesdError, match='gap|overlap'):
        dcs(m)


def test_regions_may_follow_algebraic_variables_and_fixed_ones():
    m = scalar_ode()
    m.P, m.limit = pyo.Var(m.t, initialize=3.0), pyo.Var(initialize=2.0)
    m.limit.fix()
    add_modes(m, lambda m, t: [m.P[t] * m.x[t] <= m.limit, m.dx[t] == 3], lambda m, t: [m.x[t] * m.P[t] >= m.limit, m.dx[t] == 1])
    dcs(m)
    assert modes_at(m, (0.5, 0), (0.8, 0)) == [[0], [1]]
    m.limit.value = 2.7
    assert modes_at(m, (0.8, 0), (1.0, 0)) == [[0], [1]]


@pytest.mark.parametrize('start', [0.0, 1.0])
def test_a_mutable_threshold_can_be_moved_later(start):
    m = scalar_ode()
    m.limit = pyo.Param(initialize=start, mutable=True)
    add_modes(m, lambda m, t: [m.x[t] <= m.limit, m.dx[t] == 3], lambda m, t: [m.x[t] >= m.limit, m.dx[t] == 1])
    dcs(m)
    m.limit.value = 5.0
    assert modes_at(m, (4.9, 0), (5.1, 0)) == [[0], [1]]


def test_a_region_needs_no_initial_values():
    m = two_modes(lambda m, t: m.y[t] <= 1, lambda m, t: m.y[t] >= 1)
    m.y[0].clear()
    m.y[2].clear()
    dcs(m)
    assert modes_at(m, (0, 0), (0, 2)) == [[0], [1]]


def test_reading_regions_leaves_values_and_stale_flags_alone():
    m = two_modes(lambda m, t: m.x[t] <= m.y[t], lambda m, t: m.x[t] >= m.y[t])
    m.y[2].set_value(7.0)
    m.y[0].stale = m.x[2].stale = True
    before = {v.name: (v.value, v.stale, v.fixed) for v in m.component_data_objects(pyo.Var)}
    dcs(m)
    after = {v.name: (v.value, v.stale, v.fixed) for v in m.component_data_objects(pyo.Var)}
    assert {name: after[name] for name in before} == before


# Three and more modes

#: The forms for any number of modes, with what they count: regions and switching functions.
MANY_MODES = pytest.mark.parametrize('form', ['stewart', 'heaviside'])


def size(m):
    """What the only form of a model counts: the number at the end of its block's name."""
    name, _ = form_block(m)
    return int(name.split('_')[-1])


@pytest.mark.parametrize('form, number', [('stewart', 3), ('heaviside', 2)])
def test_three_ordered_modes_with_a_ranged_inequality_get_three_regions_or_two_steps(form, number):
    m = dcs(thresholds(), form=form)
    assert size(m) == number
    assert modes_at(m, (-0.5, 0), (0.5, 0), (1.5, 0), disjunction='level') == [[0], [1], [2]]


@MANY_MODES
def test_a_full_sign_matrix_gives_the_same_regions_as_an_ordered_one(form):
    short, full = thresholds(), scalar_ode()
    add_modes(
        full,
        lambda m, t: [m.x[t] <= 0, m.x[t] <= 1, m.dx[t] == 3],
        lambda m, t: [m.x[t] >= 0, 1 >= m.x[t], m.dx[t] == 2],
        lambda m, t: [0 <= m.x[t], m.x[t] - 1 >= 0, m.dx[t] == 1],
        name='level',
    )
    assert len(generated(dcs(full, form=form), pyo.Constraint)) == len(generated(dcs(short, form=form), pyo.Constraint))
    for m in (short, full):
        assert modes_at(m, (-0.5, 0), (0.5, 0), (1.5, 0), disjunction='level') == [[0], [1], [2]]


@MANY_MODES
@pytest.mark.parametrize('scale', [1e-9, 1e-6, 1.0, 1e8])
def test_thresholds_may_be_of_any_size(scale, form):
    m = thresholds(low=scale, high=2 * scale)
    m.x[...].set_value(scale)
    dcs(m, form=form)
    states = [(0.5 * scale, 0), (1.5 * scale, 0), (2.5 * scale, 0)]
    assert size(m) == {'stewart': 3, 'heaviside': 2}[form]
    assert modes_at(m, *states, disjunction='level', tolerance=1e-3 * min(scale, 1)) == [[0], [1], [2]]


@pytest.mark.parametrize('low, high', [(1e9, 1.1e9), (1e-9, 2e-9)])
def test_thresholds_may_lie_far_from_the_initial_value(low, high):
    m = thresholds(low=low, high=high)
    m.x[...].set_value(1.0)
    dcs(m, form='stewart')
    assert size(m) == 3


@MANY_MODES
def test_close_thresholds_far_from_zero_are_told_apart(form):
    # 100 Pa between two switching pressures of 1 MPa
    m = thresholds(low=1e6, high=1e6 + 100)
    m.x[...].set_value(9e5)
    dcs(m, form=form)
    assert modes_at(m, (1e6 - 50, 0), (1e6 + 50, 0), (1e6 + 150, 0), disjunction='level') == [[0], [1], [2]]


@pytest.mark.parametrize('form, number', [('stewart', 5), ('heaviside', 4)])
def test_four_thresholds_leave_only_the_patterns_that_can_occur(form, number):
    m = scalar_ode()
    limits = [0, 1, 2, 3]
    between = [lambda m, t, a=a, b=b: [pyo.inequality(a, m.x[t], b), m.dx[t] == a] for a, b in pairwise(limits)]
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.dx[t] == -1], *between, lambda m, t: [m.x[t] >= 3, m.dx[t] == 3])
    dcs(m, form=form)
    assert size(m) == number
    assert modes_at(m, *((x, 0) for x in (-0.5, 0.5, 1.5, 2.5, 3.5))) == [[0], [1], [2], [3], [4]]


@MANY_MODES
def test_a_mode_may_leave_a_sign_open(form):
    m = dcs(quadrants(), form=form)
    found = modes_at(m, (-1, 1), (-1, -1), (1, 1), (1, -1), disjunction='corner')
    assert found == [[0], [0], [1], [2]]


@pytest.mark.parametrize('form, number', [('stewart', 4), ('heaviside', 2)])
@pytest.mark.parametrize('x0', [1e7, 1.0])
def test_modes_with_open_signs_in_different_units_of_measurement_keep_all_their_regions(x0, form, number):
    # 1e7 Pa and a mole fraction of 1e-6
    m = scalar_ode(x0=x0)
    m.y[...].set_value(1e-6)
    add_modes(
        m,
        lambda m, t: [m.x[t] <= 1e7, m.dx[t] == 0],
        lambda m, t: [m.x[t] >= 1e7, m.y[t] >= 1e-6, m.dx[t] == 1],
        lambda m, t: [m.x[t] >= 1e7, m.y[t] <= 1e-6, m.dx[t] == 2],
    )
    dcs(m, form=form)
    assert size(m) == number


@pytest.mark.parametrize('form', ['auto', 'stewart'])
def test_the_number_of_regions_follows_each_index(form):
    m = scalar_ode()
    m.i = pyo.Set(initialize=['two', 'three'])

    @m.Disjunction(m.i, m.t)
    def unit(m, i, t):
        if i == 'two':
            return [below(m, t), above(m, t)]
        return [
            [m.y[t] <= 0, m.dy[t] == 3],
            [pyo.inequality(0, m.y[t], 1), m.dy[t] == 2],
            [m.y[t] >= 1, m.dy[t] == 1],
        ]

    dcs(m, form=form)
    m.x[0].value, m.y[0].value = 1.0, 0.5
    assert modes_on(m.unit['two', 0]) == [m.unit['two', 0].disjuncts[1]]
    assert modes_on(m.unit['three', 0]) == [m.unit['three', 0].disjuncts[1]]
    assert form_of(m.unit['two', 0])[0] is not form_of(m.unit['three', 0])[0]


# What is refused


def lists(*modes):
    return lambda: add_modes(scalar_ode(), *modes)


BAD = {
    'no region in two modes': (
        lists(below, lambda m, t: [m.dx[t] == 1], lambda m, t: [m.dx[t] == 2]),
        'sgn_disjuncts[2]',
        'no region',
    ),
    'no region in any mode': (lists(lambda m, t: [m.dx[t] == 2], lambda m, t: [m.dx[t] == 1]), 'sgn_disjuncts[1]', 'no region'),
    'nothing left for the rest': (
        lists(below, above, lambda m, t: [m.dx[t] == 1]),
        'sgn_disjuncts[2]',
        'the other modes leave nothing',
    ),
    'overlap': (lists(lambda m, t: [m.x[t] <= 1, m.dx[t] == 3], above), 'sgn[0]', 'overlap'),
    'overlap of equal regions': (lists(below, lambda m, t: [2 * m.x[t] <= 0, m.dx[t] == 1]), 'sgn[0]', 'overlap'),
    'overlap in the plane': (lists(below, lambda m, t: [m.y[t] >= 0, m.dx[t] == 1]), 'sgn[0]', 'overlap|gap'),
    'gap': (lists(below, lambda m, t: [m.x[t] >= 1, m.dx[t] == 1]), 'sgn[0]', 'gap'),
    'gap in the plane': (lists(below, lambda m, t: [m.x[t] >= 0, m.y[t] >= 0, m.dx[t] == 1]), 'sgn[0]', 'gap'),
    'both signs of one function': (
        lists(lambda m, t: [m.x[t] <= 0, 3 * m.x[t] >= 0, m.dx[t] == 3], above),
        'sgn_disjuncts[0]',
        'empty',
    ),
    'an impossible range': (
        lists(
            below,
            lambda m, t: [pyo.inequality(0, m.x[t], 1), m.dx[t] == 2],
            lambda m, t: [m.x[t] >= 1, m.dx[t] == 1],
            lambda m, t: [m.x[t] <= 0, m.x[t] >= 1, m.dx[t] == 0],
        ),
        'sgn_disjuncts[3]',
        'empty',
    ),
    'an impossible range beside full patterns': (
        lists(
            lambda m, t: [m.x[t] <= 0, m.x[t] <= 1, m.dx[t] == 3],
            lambda m, t: [pyo.inequality(0, m.x[t], 1), m.dx[t] == 2],
            lambda m, t: [m.x[t] >= 0, m.x[t] >= 1, m.dx[t] == 1],
            lambda m, t: [m.x[t] <= 0, m.x[t] >= 1, m.dx[t] == 0],
        ),
        'sgn_disjuncts[3]',
        'empty',
    ),
    'a derivative in a region': (lists(lambda m, t: [m.x[t] + m.dx[t] <= 0, m.dx[t] == 3], above), 'sgn_disjuncts[0]', r'dx\[0\]'),
    'more functions than can be enumerated': (
        lists(lambda m, t: [m.dx[t] == 3, *(m.x[t] >= k for k in range(13))], below),
        'sgn[0]',
        '13',
    ),
}


@pytest.mark.parametrize('form', ['auto', 'stewart', 'heaviside'])
def test_declared_bounds_count_where_regions_leave_a_gap(form):
    """From 0.5: rate 1 to 1 at t = 0.5, then 0.5.  Nothing is said of x < 0 and x > 10, which the bounds exclude."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, bounds=(0, 10), initialize=0.5)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0.5)
    add_modes(
        m,
        lambda m, t: [m.x[t] >= 0, m.x[t] <= 1, m.dx[t] == 1],
        lambda m, t: [m.x[t] >= 1, m.x[t] <= 10, m.dx[t] == 0.5],
    )
    m = solve(move(dcs(m, form=form), 6, 2))
    assert m.x[2].value == pytest.approx(1.75)
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([0.5])


def test_bounds_do_not_hide_a_gap_inside_of_them():
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, bounds=(-1, 10), initialize=0.5)
    m.dx = dae.DerivativeVar(m.x)
    add_modes(m, lambda m, t: [m.x[t] >= 0, m.x[t] <= 1, m.dx[t] == 1], lambda m, t: [m.x[t] >= 1, m.dx[t] == 0.5])
    with pytest.raises(FesdError, match='leave a gap'):
        dcs(m)


@pytest.mark.parametrize('form', ['auto', 'stewart'])
def test_a_mode_without_inequality_may_have_a_region_that_no_signs_describe(form):
    """The rest of the quadrant x, y >= 0: rate 1 in it, 2 outside; from (-1, -1/4) y is 0 at 1/4, x at 1/2."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x, m.y = pyo.Var(m.t, initialize=-1), pyo.Var(m.t, initialize=-0.25)
    m.dx, m.dy = dae.DerivativeVar(m.x), dae.DerivativeVar(m.y)
    m.x[0].fix(-1)
    m.y[0].fix(-0.25)
    m.rises = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 1)
    add_modes(m, lambda m, t: [m.x[t] >= 0, m.y[t] >= 0, m.dx[t] == 1], lambda m, t: [m.dx[t] == 2])
    m = solve(move(dcs(m, form=form), 6, 2))
    assert m.x[2].value == pytest.approx(1.5)


@pytest.mark.parametrize('fault', BAD)
def test_wrong_regions_are_refused_by_name_and_the_model_stays_as_it_was(fault):
    build, component, cause = BAD[fault]
    m = build()
    before = snapshot(m)
    with pytest.raises(FesdError, match=cause) as refusal:
        dcs(m)
    assert refusal.value.component.startswith(component)
    assert refusal.value.fix
    assert snapshot(m) == before


@pytest.mark.parametrize('condition', [pyo.log, lambda x: pyo.sqrt(x) - 1, lambda x: x**0.5 - 1], ids=['log', 'sqrt', 'root'])
def test_a_region_that_cannot_be_evaluated_is_refused_by_name(condition):
    m = two_modes(lambda m, t: condition(m.x[t]) <= 0, lambda m, t: condition(m.x[t]) >= 0)
    before = snapshot(m)
    with pytest.raises(FesdError, match='cannot be evaluated') as refusal:
        dcs(m)
    assert refusal.value.component == 'sgn[0]'
    assert snapshot(m) == before


def test_a_region_that_overflows_is_refused_by_name():
    m = two_modes(lambda m, t: pyo.exp(m.x[t]) <= 1, lambda m, t: pyo.exp(m.x[t]) >= 1, x0=2000.0)
    with pytest.raises(FesdError, match='cannot be evaluated') as refusal:
        dcs(m)
    assert refusal.value.component == 'sgn[0]'


def test_a_region_may_have_a_pole_at_the_initial_value():
    m = two_modes(lambda m, t: 1 / m.x[t] <= 2, lambda m, t: 1 / m.x[t] >= 2, x0=0.0)
    dcs(m)
    assert modes_at(m, (1.0, 0), (0.25, 0)) == [[0], [1]]


def test_an_algebraic_variable_that_the_modes_define_cannot_decide_the_region():
    m = scalar_ode()
    m.F = pyo.Var(m.t, initialize=1.0)
    add_modes(m, lambda m, t: [m.F[t] <= 2, m.F[t] == 3 * m.x[t]], lambda m, t: [m.F[t] >= 2, m.F[t] == m.x[t]])
    before = snapshot(m)
    with pytest.raises(FesdError, match=r'F\[0\]') as refusal:
        dcs(m)
    assert refusal.value.component == 'sgn[0]'
    assert snapshot(m) == before


def test_thresholds_in_the_wrong_order_are_found_in_the_unit_that_has_them():
    m = scalar_ode()
    m.i = pyo.Set(initialize=['good', 'bad'])
    low, high = {'good': 1, 'bad': 2}, {'good': 2, 'bad': 1}
    state, speed = {'good': m.x, 'bad': m.y}, {'good': m.dx, 'bad': m.dy}

    @m.Disjunction(m.i, m.t)
    def unit(m, i, t):
        return [
            [state[i][t] <= low[i], speed[i][t] == 3],
            [state[i][t] >= low[i], state[i][t] <= high[i], speed[i][t] == 2],
            [state[i][t] >= high[i], speed[i][t] == 1],
        ]

    before = snapshot(m)
    with pytest.raises(FesdError) as refusal:
        dcs(m)
    assert refusal.value.component == 'unit[bad,0]'
    assert snapshot(m) == before
