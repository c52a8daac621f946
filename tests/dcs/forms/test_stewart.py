"""Stewart's form for three and more modes (theory, eq. 3 and 4)."""

from math import cos, sin

import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.mpec import Complementarity

from pyomo_fesd import FesdError
from pyomo_fesd.core import all_switched_systems
from tests.models import (
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
    signum,
    snapshot,
    tank,
    thresholds,
    violation,
)
from tests.problems.forms_of import form_block


def test_three_modes_cost_seven_variables_five_equations_and_three_pairs_a_time():
    m = dcs(thresholds(), form='stewart')
    sizes = [len(generated(m, ctype)) for ctype in (pyo.Var, pyo.Constraint, Complementarity)]
    assert sizes == [7 * len(m.t), 5 * len(m.t), 3 * len(m.t)]


@pytest.mark.parametrize('x, dx', [(-1.0, 3), (0.25, 2), (4.0, 1)])
def test_each_interval_has_its_own_rate(x, dx):
    m = dcs(thresholds(), form='stewart')
    m.x[0].value = x
    assert len(modes_on(m.level[0])) == 1
    assert rate(m.level[0], m.dx[0]) == pytest.approx(dx)


def test_lam_is_the_distance_of_g_from_its_minimum():
    # g = -S c with c = (x, x - 1), or the negative of either: (2x - 1, -1, 1 - 2x)
    m = dcs(thresholds(), form='stewart')
    m.x[0].value = 0.25
    put_on(m.level[0], 2)
    block, _ = form_of(m.level[0])
    assert [block.lam[0, i].value for i in (1, 2, 3)] == pytest.approx([0.5, 0.0, 1.5])
    assert block.mu[0].value == pytest.approx(-1)


def test_on_a_threshold_only_its_two_neighbours_can_be_on():
    m = dcs(thresholds(), form='stewart')
    m.x[0].value = 1.0
    assert modes_on(m.level[0]) == m.level[0].disjuncts[1:]


def test_the_multipliers_of_all_modes_sum_up_to_one():
    m = dcs(thresholds(), form='stewart')
    put_on(m.level[0], 1)
    block, _ = form_of(m.level[0])
    assert violation(m.level[0]) == pytest.approx(0)
    block.nu[0, 1].value = 0.5
    assert violation(m.level[0]) == pytest.approx(0.5)


def test_a_mode_with_an_open_sign_is_on_with_the_sum_of_its_regions():
    m = dcs(quadrants(), form='stewart')
    m.x[0].value, m.y[0].value = -1.0, 0.0  # between the two regions of 'left'
    left = m.corner[0].disjuncts[0]
    assert modes_on(m.corner[0]) == [left]
    block, _ = form_of(m.corner[0])
    weight = pyo.TransformationFactory('fesd.dcs').get_multipliers(m.corner[0])[left]
    source = pyo.TransformationFactory('fesd.dcs').get_src_disjunct
    for i in block.regions:
        block.nu[0, i].value = 0.5 if source(block.complementarity[0, i]) is left else 0.0
    assert pyo.value(weight) == pytest.approx(1)
    assert violation(m.corner[0]) == pytest.approx(0)
    assert rate(m.corner[0], m.dx[0]) == pytest.approx(0)


def test_the_multipliers_start_at_the_initial_state():
    m = dcs(thresholds(), form='stewart')
    block, _ = form_of(m.level[0])
    start = [block.lam[0, i].value for i in block.regions]
    put_on(m.level[0], 1)
    assert start == pytest.approx([block.lam[0, i].value for i in block.regions])


def test_the_multipliers_are_bounded():
    block, _ = form_of(dcs(thresholds(), form='stewart').level[0])
    assert [block.nu[0, 1].bounds, block.lam[0, 1].bounds, block.mu[0].bounds] == [(0, 1), (0, None), (None, None)]


def test_continuous_multipliers_and_independent_selectors_are_recorded_for_the_elements():
    m = dcs(thresholds(), form='stewart')
    block, _ = form_of(m.level[0])
    systems = all_switched_systems(m)
    continuous = list(systems.continuous)
    assert len(continuous) == 2 and all(any(v is part for part in (block.lam, block.mu)) for v in continuous)
    assert len(systems.selectors) == 2 * len(m.t)


def test_two_modes_can_be_written_in_stewarts_form_on_request():
    m = dcs(signum(), form='stewart')
    assert form_block(m)[0] == 'stewart_2'
    for x, on, dx in ((-2.0, m.below[0], 3), (1.5, m.above[0], 1)):
        m.x[0].value = x
        assert modes_on(m.sgn[0]) == [on]
        assert rate(m.sgn[0], m.dx[0]) == pytest.approx(dx)


def test_stewarts_form_blends_algebraic_variables_too():
    m = dcs(tank(), form='stewart')
    m.M[0].value = 2.0
    assert modes_on(m.outlet[0]) == [m.empty[0]]
    assert [rate(m.outlet[0], v) for v in (m.L[0], m.G[0])] == pytest.approx([0, 0.4])


def test_the_form_of_two_modes_has_another_name():
    m = thresholds()
    before = snapshot(m)
    with pytest.raises(FesdError, match="form='two_mode' has another name") as refusal:
        dcs(m, form='two_mode')
    assert (refusal.value.component, refusal.value.fix) == ('fesd.dcs', "write form='heaviside'")
    assert snapshot(m) == before


SIGNS = {
    'four quadrants': [(1, 1), (1, -1), (-1, 1), (-1, -1)],
    'three modes, one open sign': [(1, 1), (1, -1), (-1, 0)],
    'three modes, the other open': [(0, 1), (1, -1), (-1, -1)],
}
numbers = st.integers(-3, 3)
factors = st.lists(st.sampled_from([1e-3, 0.5, 1.0, 7.0, 1e3]), min_size=2, max_size=2)


@st.composite
def corners(draw):
    """Two crossing lines, three or four modes in any order and writing, and a point clearly inside a region."""
    first = draw(st.floats(0, 6.28))
    second = first + draw(st.floats(0.3, 2.8)) * draw(st.sampled_from([1, -1]))
    functions = [(cos(angle), sin(angle), draw(st.floats(-2, 2))) for angle in (first, second)]
    modes = [
        {'signs': signs, 'rates': (draw(numbers), draw(numbers)), 'factors': draw(factors), 'writing': draw(st.integers(0, 3))}
        for signs in draw(st.permutations(SIGNS[draw(st.sampled_from(sorted(SIGNS)))]))
    ]
    # the point from its values of the two functions
    p, q = (draw(st.sampled_from([-1, 1])) * draw(st.floats(0.05, 5)) - functions[k][2] for k in (0, 1))
    (a, b, _), (c, d, _) = functions
    point = ((d * p - b * q) / (a * d - b * c), (a * q - c * p) / (a * d - b * c))
    return functions, modes, point, draw(st.sampled_from([-2.0, 0.0, 1.0]))


@settings(max_examples=40, deadline=None)
@given(corners())
def test_inside_a_region_only_its_own_mode_is_on_with_its_own_rates(system):
    functions, modes, (x, y), x0 = system
    m = dcs(planar(functions, modes, x0=x0), form='stewart')
    assert form_block(m)[0] == 'stewart_4'
    m.x[0].value, m.y[0].value = x, y
    number = owner(functions, modes, x, y)
    assert modes_on(m.sgn[0], tolerance=1e-6) == [m.sgn[0].disjuncts[number]]
    assert violation(m.sgn[0]) == pytest.approx(0, abs=1e-9)
    assert [rate(m.sgn[0], v) for v in (m.dx[0], m.dy[0])] == pytest.approx(rates_of(modes[number], x, y), abs=1e-9)
