"""Two modes on the two sides of one switching function: one step function, which is the multiplier (theory, eq. 5)."""

from math import cos, sin

import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.mpec import Complementarity

from pyomo_fesd.core import all_switched_systems
from tests.models import (
    above,
    add_modes,
    below,
    dcs,
    generated,
    modes_on,
    owner,
    planar,
    put_on,
    rate,
    rates_of,
    residual,
    scalar_ode,
    signum,
    tank,
    violation,
)


def test_two_modes_cost_three_variables_two_equations_and_two_pairs_a_time():
    m = dcs(signum())
    sizes = [len(generated(m, ctype)) for ctype in (pyo.Var, pyo.Constraint, Complementarity)]
    assert sizes == [3 * len(m.t), 2 * len(m.t), 2 * len(m.t)]


def test_the_parts_of_the_switching_function_sum_up_to_it():
    m = dcs(signum())
    block = m._pyomo_fesd_dcs.sgn
    for x, p, n in ((-2.0, 2.0, 0.0), (3.0, 0.0, 3.0)):  # 'below' comes first: c = -x
        m.x[0].value = x
        block.p[0].value, block.n[0].value = p, n
        assert residual(block.switching[0]) == pytest.approx(0)


@pytest.mark.parametrize('x, on, dx', [(-2.0, 'below', 3.0), (1.5, 'above', 1.0)])
def test_each_side_has_its_own_mode_and_rate(x, on, dx):
    m = dcs(signum())
    m.x[0].value = x
    assert modes_on(m.sgn[0]) == [m.component(on)[0]]
    assert rate(m.sgn[0], m.dx[0]) == pytest.approx(dx)


def test_the_order_of_the_disjuncts_does_not_matter():
    m = dcs(add_modes(scalar_ode(), above, below))
    for x, dx in ((-2.0, 3.0), (1.5, 1.0)):
        m.x[0].value = x
        modes_on(m.sgn[0])
        assert rate(m.sgn[0], m.dx[0]) == pytest.approx(dx)


def test_on_the_surface_any_mixture_of_the_modes_is_allowed():
    m = dcs(signum())
    m.x[0].value = 0.0
    assert modes_on(m.sgn[0]) == [m.below[0], m.above[0]]
    put_on(m.sgn[0], 1)
    m._pyomo_fesd_dcs.sgn.alpha[0].value = 0.3
    assert violation(m.sgn[0]) == pytest.approx(0)
    assert rate(m.sgn[0], m.dx[0]) == pytest.approx(0.3 * 3 + 0.7 * 1)


def test_off_the_surface_no_mixture_is_allowed():
    m = dcs(signum())
    put_on(m.sgn[0], 1)
    m._pyomo_fesd_dcs.sgn.alpha[0].value = 0.3
    assert violation(m.sgn[0]) > 0.1


def test_the_multipliers_start_at_the_initial_state():
    m = dcs(tank())
    block = m._pyomo_fesd_dcs.outlet
    assert [block.p[0].value, block.n[0].value] == [3.0, 0.0]  # M = 8 at a threshold of 5
    assert 0 < block.alpha[0].value < 1


def test_the_multipliers_are_bounded():
    block = dcs(signum())._pyomo_fesd_dcs.sgn
    assert [block.alpha[0].bounds, block.p[0].bounds, block.n[0].bounds] == [(0, 1), (0, None), (0, None)]


def test_continuous_parts_and_selector_are_recorded_for_the_elements():
    m = dcs(signum())
    block = m._pyomo_fesd_dcs.sgn
    systems = all_switched_systems(m)
    continuous = list(systems.continuous)
    assert len(continuous) == 2 and all(any(v is part for part in (block.p, block.n)) for v in continuous)
    assert [v is block.alpha for v in systems.selectors] == [True]


angles = st.floats(0, 6.28)
offsets = st.floats(-2, 2)
factors = st.lists(st.sampled_from([1e-3, 0.5, 1.0, 7.0, 1e3]), min_size=2, max_size=2)
numbers = st.integers(-3, 3)


@st.composite
def half_planes(draw):
    """One switching function, its two modes in any order and writing, and a point clearly on one side."""
    angle = draw(angles)
    function = (cos(angle), sin(angle), draw(offsets))
    modes = [
        {
            'signs': (sign,),
            'rates': (draw(numbers), draw(numbers)),
            'factors': draw(factors),
            'writing': draw(st.integers(0, 3)),
        }
        for sign in draw(st.permutations([1, -1]))
    ]
    distance = draw(st.sampled_from([-1, 1])) * draw(st.floats(0.05, 5)) - function[2]
    along = draw(st.floats(-5, 5))
    point = (distance * cos(angle) - along * sin(angle), distance * sin(angle) + along * cos(angle))
    return [function], modes, point, draw(st.sampled_from([-2.0, 0.0, 1.0]))


@settings(max_examples=40, deadline=None)
@given(half_planes())
def test_inside_a_region_only_its_own_mode_is_on_with_its_own_rates(system):
    functions, modes, (x, y), x0 = system
    m = dcs(planar(functions, modes, x0=x0))
    assert list(m._pyomo_fesd_dcs.component_map()) == ['sgn']
    m.x[0].value, m.y[0].value = x, y
    number = owner(functions, modes, x, y)
    assert modes_on(m.sgn[0]) == [m.sgn[0].disjuncts[number]]
    assert violation(m.sgn[0]) == pytest.approx(0, abs=1e-9)
    assert [rate(m.sgn[0], v) for v in (m.dx[0], m.dy[0])] == pytest.approx(rates_of(modes[number], x, y), abs=1e-9)
