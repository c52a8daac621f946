"""Switches at the boundary of two control stages at which there are conditions: certificates against exact slopes."""

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import pyomo_fesd
from tests.problems import coupled_relays
from tests.problems.running import EXACT_SCHEMES, LEGENDRE, RADAU, transform
from tests.problems.switch_at_boundary import CONDITIONS, Boundary

#: Slopes nearer to 0 are not told from it.
CLEAR = 0.02

numbers = st.floats(-1, 1).map(lambda v: round(v, 2))
rates = st.floats(0.3, 3).map(lambda v: round(v, 2))
rows = st.builds(Boundary, rates, numbers, numbers, numbers, st.sampled_from(sorted(CONDITIONS)))
bounds = st.builds(Boundary, rates, numbers, numbers, numbers, st.sampled_from(('at least', 'at most')), st.just(True))


@settings(max_examples=25, deadline=None)
@given(st.one_of(rows, bounds), st.sampled_from((4, 6)), st.sampled_from(EXACT_SCHEMES))
@example(Boundary(1.21, -0.7, -0.1, 0.59), 6, (LEGENDRE, 1))
@example(Boundary(2.7, 0.0, -0.75, -0.42, 'at least'), 6, (LEGENDRE, 2))
@example(Boundary(2.68, 0.0, -0.31, 0.99, 'at least', True), 6, (RADAU, 1))
@example(Boundary(1.16, 0.0, -0.62, 0.35, 'gains at most'), 4, (LEGENDRE, 1))
@example(Boundary(0.39, 0.0, -0.9, 0.1, 'at most', True), 4, (RADAU, 2))
@example(Boundary(0.5, 0.9, 0.1, -0.2), 4, (RADAU, 2))
def test_a_switch_at_a_boundary_is_certified_if_and_only_if_no_slope_descends(boundary, nfe, scheme):
    slopes = boundary.slopes
    assume(min(abs(slopes)) > CLEAR)
    assert pyomo_fesd.certify(boundary.build(nfe, scheme[1], scheme[0])).certified == (min(slopes) > 0)


@pytest.mark.parametrize('condition', ['at least', 'gains at most'])
def test_on_one_element_for_each_stage_nothing_is_certified_that_descends(condition):
    for w in (-0.5, 0.5):
        boundary = Boundary(2.0, 0.0, -0.1, w, condition)
        assert min(boundary.slopes) < -CLEAR
        for name, ncp in EXACT_SCHEMES:
            assert not pyomo_fesd.certify(boundary.build(2, ncp, name)).certified


def squared(m):
    """The square of an integral, which is no sum over the elements."""
    m.area = dae.Integral(m.t, rule=lambda m, t: m.s[t, 1] - 0.5 * m.s[t, 2])
    of_states = m.cost.expr
    m.del_component('cost')
    m.cost = pyo.Objective(expr=of_states + 2 * (m.area + SHIFT) ** 2)


SHIFT = 0.3


def slopes_with_square(relays):
    """Those of the objective with the square, for smaller and larger theta."""

    def objective(theta):
        first, second = relays.seconds(theta)
        return relays.objective(theta) + 2 * (first - 0.5 * second + SHIFT) ** 2

    return [(objective(1 + step) - objective(1)) / 1e-5 for step in (-1e-5, 1e-5)]


def test_with_the_square_of_an_integral_nothing_is_certified_that_descends():
    tried = 0
    for seed in range(40):
        relays = coupled_relays.Relays.draw(seed)
        slopes = slopes_with_square(relays)
        if min(slopes) > -CLEAR or min(map(abs, slopes)) < CLEAR:
            continue
        tried += 1
        m = transform(coupled_relays.build(relays, squared), 3, 3)
        m.theta.fix(1)
        pyomo_fesd.simulate(m)
        m.theta.unfix()
        assert not pyomo_fesd.certify(m).certified
    assert tried > 10


@pytest.mark.parametrize('seed', [1, 2, 5])
def test_two_switches_at_a_boundary_are_not_certified_where_a_slope_descends(seed):
    drawn = coupled_relays.Relays.draw(seed)
    relays = coupled_relays.Relays(drawn.r, drawn.r[:, 0, 0] - drawn.q, drawn.q, drawn.w)
    assert not relays.is_minimum
    m = transform(coupled_relays.build(relays, times=(0, 1, 2)), 6, 2)
    m.theta.fix(1)
    pyomo_fesd.simulate(m)
    m.theta.unfix()
    assert not pyomo_fesd.certify(m).certified
