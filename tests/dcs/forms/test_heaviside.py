"""The Heaviside form: one step variable for each switching function (theory, eq. 6)."""

import itertools
from math import cos, sin

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.mpec import Complementarity

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core import all_switched_systems
from tests.models import (
    add_modes,
    collocate,
    dcs,
    form_of,
    generated,
    modes_on,
    owner,
    planar,
    put_on,
    quadrants,
    rate,
    rates_of,
    scalar_ode,
    signum,
    tank,
    thresholds,
    turn_on,
    violation,
    weights,
)
from tests.problems.forms_of import form_block
from tests.problems.running import LEGENDRE, RADAU, move, seen, solve


def three_sectors():
    """Three modes round the origin; each of two sign patterns is touched there only, and no mode can take it in."""
    return add_modes(
        scalar_ode(x0=1.0),
        lambda m, t: [m.x[t] >= 0, m.x[t] + m.y[t] >= 0, m.dx[t] == 1],
        lambda m, t: [m.x[t] <= 0, m.y[t] >= 0, m.dx[t] == 2],
        lambda m, t: [m.y[t] <= 0, m.x[t] + m.y[t] <= 0, m.dx[t] == 3],
    )


# Which form


@pytest.mark.parametrize(
    'build, name',
    [
        (signum, ''),
        (thresholds, 'heaviside_2'),
        (quadrants, 'heaviside_2'),
        (three_sectors, 'stewart_6'),
    ],
)
def test_auto_takes_the_smallest_form_that_fits(build, name):
    assert form_block(dcs(build()))[0] == name


def test_of_two_forms_of_the_same_size_auto_takes_stewarts():
    # four intervals: 4*4 + 2 in Stewart's form, three steps of 6
    m = scalar_ode()
    limits = (0, 1, 2)
    inner = [lambda m, t, a=a: [pyo.inequality(a, m.x[t], a + 1), m.dx[t] == a] for a in limits[:-1]]
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.dx[t] == 5], *inner, lambda m, t: [m.x[t] >= 2, m.dx[t] == 4])
    assert form_block(dcs(m))[0] == 'stewart_4'


@pytest.mark.parametrize('build', [thresholds, quadrants])
@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
def test_a_form_counts_what_it_writes(build, form):
    m = dcs(build(), form=form)
    name, block = form_block(m)
    modes = len(block.mode)
    written = sum(len(generated(m, ctype)) for ctype in (pyo.Var, pyo.Constraint, Complementarity)) - modes
    number = int(name.split('_')[-1])
    assert written == {'stewart': 4 * number + 2, 'heaviside': 6 * number}[form] * len(m.t)


def test_where_the_weights_would_not_sum_up_to_one_the_form_is_refused_by_name():
    m = three_sectors()
    before = seen(m)
    with pytest.raises(FesdError, match="form='heaviside' does not fit: where .* the signs of 0 modes fit") as refusal:
        dcs(m, form='heaviside')
    assert refusal.value.component == 'sgn[0]' and "form='auto'" in refusal.value.fix
    assert seen(m) == before


def test_a_sector_that_can_take_in_what_is_touched_at_the_corner_does():
    # six sectors of three lines through the origin: of their three signs two suffice in two of them
    m = scalar_ode(x0=1.0)
    signs = [(1, 1, 1), (1, -1, 1), (1, -1, -1), (-1, -1, -1), (-1, 1, -1), (-1, 1, 1)]

    def mode(i):
        def write(m, t):
            c = (m.x[t], m.y[t], m.x[t] + m.y[t])
            return [*(s * c_k >= 0 for s, c_k in zip(signs[i], c)), m.dx[t] == i, m.dy[t] == i * i]

        return write

    add_modes(m, *(mode(i) for i in range(6)))
    assert form_block(dcs(m))[0] == 'heaviside_3'
    m.x[0].value, m.y[0].value = 0.0, 0.0
    for number in range(1, 9):
        put_on(m.sgn[0], number)
        assert violation(m.sgn[0]) == pytest.approx(0)
        assert sum(pyo.value(w) for w in weights(m.sgn[0]).values()) == pytest.approx(1)


# What it writes


def test_three_intervals_cost_six_variables_two_equations_and_four_pairs_a_time():
    m = dcs(thresholds(), form='heaviside')
    sizes = [len(generated(m, ctype)) for ctype in (pyo.Var, pyo.Constraint, Complementarity)]
    assert sizes == [6 * len(m.t), 3 * len(m.t), 4 * len(m.t)]


def test_a_sign_that_does_not_matter_leaves_no_factor():
    m = dcs(quadrants(), form='heaviside')
    left, upper, lower = (str(w) for w in weights(m.corner[0]).values())
    assert left.count('alpha') == 1 and upper.count('alpha') == lower.count('alpha') == 2


def test_a_function_that_does_not_matter_costs_nothing():
    m = scalar_ode()
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.x[t] <= 5, m.dx[t] == 3], lambda m, t: [m.x[t] >= 0, m.dx[t] == 1])
    dcs(m)
    assert form_block(m)[0] == ''
    m.x[0].value = 1.0
    assert modes_on(m.sgn[0]) == [m.sgn[0].disjuncts[1]]


def test_modes_with_the_same_equation_share_a_factor():
    # 'upper' and 'lower' differ in dx only: dy needs the sign of x alone
    m = scalar_ode()
    add_modes(
        m,
        lambda m, t: [m.x[t] <= 0, m.dx[t] == 0, m.dy[t] == 1],
        lambda m, t: [m.x[t] >= 0, m.y[t] >= 0, m.dx[t] == 1, m.dy[t] == -m.x[t]],
        lambda m, t: [m.x[t] >= 0, m.y[t] <= 0, m.dx[t] == 2, m.dy[t] == -m.x[t]],
    )
    dcs(m)
    block, _ = form_of(m.sgn[0])
    dy = str(block.mode[0, 2].expr)
    assert 'alpha[0,1]' in dy and 'alpha[0,2]' not in dy
    assert dy.count('alpha') == 2


@pytest.mark.parametrize('x, dx', [(-1.0, 3), (0.25, 2), (4.0, 1)])
def test_each_interval_has_its_own_rate(x, dx):
    m = dcs(thresholds(), form='heaviside')
    m.x[0].value = x
    assert len(modes_on(m.level[0])) == 1
    assert rate(m.level[0], m.dx[0]) == pytest.approx(dx)


def test_on_a_threshold_only_its_two_neighbours_can_be_on():
    m = dcs(thresholds(), form='heaviside')
    m.x[0].value = 1.0
    assert modes_on(m.level[0]) == m.level[0].disjuncts[1:]


def test_two_modes_can_be_written_with_a_step_variable_on_request():
    m = dcs(signum(), form='heaviside')
    assert form_block(m)[0] == ''
    for x, on, dx in ((-2.0, m.below[0], 3), (1.5, m.above[0], 1)):
        m.x[0].value = x
        assert modes_on(m.sgn[0]) == [on]
        assert rate(m.sgn[0], m.dx[0]) == pytest.approx(dx)


def test_algebraic_variables_are_blended_too():
    m = dcs(tank(), form='heaviside')
    m.M[0].value = 2.0
    assert modes_on(m.outlet[0]) == [m.empty[0]]
    assert [rate(m.outlet[0], v) for v in (m.L[0], m.G[0])] == pytest.approx([0, 0.4])


def test_the_step_variables_start_at_the_initial_state():
    m = dcs(thresholds(), form='heaviside')
    block, _ = form_of(m.level[0])
    assert [block.alpha[0, k].value for k in block.functions] == [0.9, 0.9]  # x = -2: below 0 and below 1
    start = [part[0, k].value for part in (block.p, block.n) for k in block.functions]
    put_on(m.level[0], 1)
    assert start == pytest.approx([part[0, k].value for part in (block.p, block.n) for k in block.functions])
    assert [block.alpha[0, 1].bounds, block.p[0, 1].bounds, block.n[0, 1].bounds] == [(0, 1), (0, None), (0, None)]


def test_continuous_parts_and_step_variables_are_recorded_for_the_elements():
    m = dcs(thresholds(), form='heaviside')
    block, _ = form_of(m.level[0])
    systems = all_switched_systems(m)
    rules = list(systems.continuous.items())
    assert [v is part for (v, _), part in zip(rules, (block.p, block.n))] == [True, True]
    assert all(rule is block.switching for _, rule in rules)
    assert [v is block.alpha for v in systems.selectors] == [True]


def test_a_pair_knows_its_disjunct_where_its_step_variable_is_the_multiplier_of_one():
    m = dcs(thresholds(), form='heaviside')
    block, _ = form_of(m.level[0])
    low, _, high = m.level[0].disjuncts
    source = pyo.TransformationFactory('fesd.dcs').get_src_disjunct
    found = {}
    for k, side in itertools.product((1, 2), (1, 2)):
        try:
            found[k, side] = source(block.complementarity[0, k, side])
        except KeyError:
            found[k, side] = None
    # c = -x (of 'low') and 1 - x: 'low' where the first is positive, 'high' where the second is negative
    assert found == {(1, 1): low, (1, 2): None, (2, 1): None, (2, 2): high}
    disjunction = pyo.TransformationFactory('fesd.dcs').get_src_disjunction
    assert all(disjunction(block.complementarity[0, k, side]) is m.level[0] for k, side in found)


def test_the_weight_of_every_mode_is_recorded():
    m = dcs(quadrants(), form='heaviside')
    for disjunct in m.corner[0].disjuncts:
        turn_on(m.corner[0], disjunct)
        multipliers = all_switched_systems(m).multipliers
        on = {d.name: pyo.value(w) for d, w in multipliers.items() if d.name.endswith(('[0]', '[1]', '[2]'))}
        assert on[disjunct.name] == 1 and sum(on.values()) == 1


# A law

SIGNS = {
    'four quadrants': [(1, 1), (1, -1), (-1, 1), (-1, -1)],
    'three modes, one open sign': [(1, 1), (1, -1), (-1, 0)],
    'three modes, the other open': [(0, 1), (1, -1), (-1, -1)],
}
numbers = st.integers(-3, 3)


@st.composite
def corners_of_lines(draw):
    """Two crossing lines, three or four modes in any order and writing, and the distances of a point from both lines."""
    first = draw(st.floats(0, 6.28))
    second = first + draw(st.floats(0.3, 2.8)) * draw(st.sampled_from([1, -1]))
    functions = [(cos(angle), sin(angle), draw(st.floats(-2, 2))) for angle in (first, second)]
    modes = [
        {'signs': signs, 'rates': (draw(numbers), draw(numbers)), 'factors': [1.0, 7.0], 'writing': draw(st.integers(0, 3))}
        for signs in draw(st.permutations(SIGNS[draw(st.sampled_from(sorted(SIGNS)))]))
    ]
    return functions, modes, [draw(st.sampled_from([-1, 1])) * draw(st.floats(0.05, 5)) for _ in range(2)]


def point(functions, distances):
    """The point at given values of the two functions."""
    p, q = (value - function[2] for value, function in zip(distances, functions))
    (a, b, _), (c, d, _) = functions
    return (d * p - b * q) / (a * d - b * c), (a * q - c * p) / (a * d - b * c)


def weights_at(m, number):
    """The modes' weights with the step variables at a corner, and whether eq. (5) allows it at the present state."""
    put_on(m.sgn[0], number)
    return [pyo.value(w) for w in weights(m.sgn[0]).values()], violation(m.sgn[0]) <= 1e-6


@settings(max_examples=40, deadline=None)
@given(corners_of_lines())
def test_inside_a_region_only_its_own_mode_is_on_with_its_own_rates(system):
    functions, modes, distances = system
    m = dcs(planar(functions, modes), form='heaviside')
    m.x[0].value, m.y[0].value = x, y = point(functions, distances)
    assert modes_on(m.sgn[0], tolerance=1e-6) == [m.sgn[0].disjuncts[owner(functions, modes, x, y)]]
    rates = rates_of(modes[owner(functions, modes, x, y)], x, y)
    assert [rate(m.sgn[0], v) for v in (m.dx[0], m.dy[0])] == pytest.approx(rates, abs=1e-8)


@settings(max_examples=40, deadline=None)
@given(corners_of_lines(), st.sets(st.sampled_from([0, 1]), min_size=1), st.floats(0, 1), st.floats(0, 1))
def test_on_surfaces_the_weights_of_the_modes_around_sum_up_to_one(system, on_surface, a, b):
    functions, modes, distances = system
    m = dcs(planar(functions, modes), form='heaviside')
    here = [0.0 if k in on_surface else value for k, value in enumerate(distances)]
    m.x[0].value, m.y[0].value = x, y = point(functions, here)
    around = [i for i, mode in enumerate(modes) if all(s * c >= 0 for s, c in zip(mode['signs'], here))]
    found = [weight for weight, allowed in (weights_at(m, number) for number in range(1, 5)) if allowed]
    assert len(found) == 2 ** len(on_surface)
    for weight in found:
        assert sum(weight) == pytest.approx(1)
        assert {i for i, w in enumerate(weight) if w} <= set(around)
    block, _ = form_of(m.sgn[0])
    for k, value in zip(block.functions, (a, b)):
        if block.p[0, k].value + block.n[0, k].value <= 1e-6:
            block.alpha[0, k].value = value
    mixed = [pyo.value(w) for w in weights(m.sgn[0]).values()]
    assert sum(mixed) == pytest.approx(1) and min(mixed) >= 0


# The whole path


@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
@pytest.mark.parametrize('scheme, ncp', [(RADAU, 2), (RADAU, 3), (LEGENDRE, 2)])
def test_two_thresholds_are_crossed_at_their_times(scheme, ncp, form):
    # from -2 at rate 3, then 2, then 1: at 0 after 2/3, at 1 after 1/2 more, at 11/6 after 2
    m = thresholds()
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    m.y[0].fix(1)
    solve(move(dcs(m, form=form), 8, ncp, scheme=scheme))
    assert [s.time for s in pyomo_fesd.switches(m)] == pytest.approx([2 / 3, 7 / 6], abs=1e-9)
    assert m.x[2].value == pytest.approx(11 / 6, abs=1e-9)


def corner(discretised):
    """y falls at rate 1 from 1; right of x = 0 x falls while y > 0 and rises below, left of it x rises."""
    m = scalar_ode(x0=1.0)
    m.fall = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == -1)
    m.y[0].fix(1)
    if discretised:
        collocate(m, nfe=9)
    return add_modes(
        m,
        lambda m, t: [m.x[t] <= 0, m.dx[t] == 1],
        lambda m, t: [m.x[t] >= 0, m.y[t] >= 0, m.dx[t] == -3],
        lambda m, t: [m.x[t] >= 0, m.y[t] <= 0, m.dx[t] == 1],
        name='corner',
    )


@pytest.mark.parametrize('form', ['stewart', 'heaviside'])
@pytest.mark.parametrize('discretised', [False, True])
def test_a_slide_between_two_of_three_modes_is_entered_and_left(form, discretised):
    m = solve(move(dcs(corner(discretised), form=form), 9, 2))
    found = pyomo_fesd.switches(m)
    assert [(s.before, s.after) for s in found] == [
        ('mode 2', 'sliding mode 1 | mode 2'),
        ('sliding mode 1 | mode 2', 'mode 3'),
    ]
    assert [s.time for s in found] == pytest.approx([1 / 3, 1], abs=1e-8)
    assert m.x[2].value == pytest.approx(1, abs=1e-8)
    assert [d.indicator_var.value for d in m.corner[2].disjuncts] == [False, False, True]


def corner_slide():
    """x and y are driven to 0 from both sides; z grows at rate 4 in the quadrant x, y > 0; its end value is maximised."""
    m = scalar_ode(x0=0.5)
    m.y[0].fix(0.25)
    m.z = pyo.Var(m.t, initialize=0)
    m.dz = dae.DerivativeVar(m.z)
    m.z[0].fix(0)

    def quadrant(sx, sy):
        return lambda m, t: [
            sx * m.x[t] >= 0,
            sy * m.y[t] >= 0,
            m.dx[t] == -sx,
            m.dy[t] == -sy,
            m.dz[t] == (4 if sx > 0 and sy > 0 else 0),
        ]

    add_modes(m, *(quadrant(sx, sy) for sx in (1, -1) for sy in (1, -1)))
    m.most = pyo.Objective(expr=m.z[2], sense=pyo.maximize)
    return m


@pytest.mark.parametrize('form, later_rate', [('stewart', 2), ('heaviside', 1)])
def test_where_two_surfaces_meet_the_forms_take_different_members_of_filippovs_set(form, later_rate):
    # z' = 4 until y = 0 at 1/4, then half of it until x = 0 at 1/2.  At rest in the corner nu_1 + nu_2 = nu_1 + nu_3 = 1/2:
    # eq. (6) takes 1/2 * 1/2 of the quadrant, Stewart's form leaves 0 <= nu_1 <= 1/2 open
    m = solve(move(dcs(corner_slide(), form=form), 8, 2))
    assert m.z[2].value == pytest.approx(4 / 4 + 2 / 4 + later_rate * 1.5, abs=1e-6)
