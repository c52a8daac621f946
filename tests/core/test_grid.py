"""The grid of pyomo.dae read back: elements, control stages, collocation points, and the quadrature of the scheme."""

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyomo_fesd import FesdError
from pyomo_fesd.core.grid import label_decimals, read_grid
from pyomo_fesd.finite_elements.expansion import discretise
from tests.problems.running import LEGENDRE, RADAU, SCHEMES, move

NCP = range(1, 6)


def model(points=(0, 2)):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=points)
    m.x = pyo.Var(m.t)
    m.dx = dae.DerivativeVar(m.x)
    return m


def grid(points=(0, 2), nfe=4, ncp=2, scheme=RADAU):
    m = move(model(points), nfe, ncp, scheme=scheme)
    return read_grid(m.t, list(points)), m.t


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('ncp', NCP)
def test_every_label_belongs_to_one_element(scheme, ncp):
    g, t = grid(nfe=4, ncp=ncp, scheme=scheme)
    assert [e.n for e in g.elements] == [1, 2, 3, 4]
    assert g.elements[0].left == t.first() and g.elements[-1].right == t.last()
    assert all(a.right == b.left for a, b in zip(g.elements, g.elements[1:]))
    assert all(len(e.points) == ncp for e in g.elements)
    labels = sorted({t.first(), *(label for e in g.elements for label in (*e.points, e.right))})
    assert labels == list(t)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('ncp', NCP)
def test_stage_points_lie_where_the_scheme_has_them(scheme, ncp):
    g, _ = grid(nfe=4, ncp=ncp, scheme=scheme)
    roots = np.polynomial.legendre.Legendre.basis(ncp).roots()
    if scheme == RADAU:
        # zeros of P_K - P_(K-1), from left to right on [-1, 1]; the last is 1
        legendre = np.polynomial.legendre.Legendre
        roots = (legendre.basis(ncp) - legendre.basis(ncp - 1)).roots()
    assert g.tau == pytest.approx((np.sort(roots.real) + 1) / 2, abs=1e-12)
    assert g.right_is_collocated is (scheme == RADAU)
    for e in g.elements:
        assert e.points == pytest.approx([e.left + c * e.length for c in g.tau], abs=1e-6)


def test_points_that_were_there_before_are_stage_boundaries():
    g, _ = grid(points=(0, 0.5, 2), nfe=6)
    assert [(e.stage, e.opens_stage) for e in g.elements] == [(1, True), (1, False), (1, False), (2, True), (2, False), (2, False)]
    assert {stage: [e.n for e in elements] for stage, elements in g.stages.items()} == {1: [1, 2, 3], 2: [4, 5, 6]}


def test_unequal_stages_get_equal_numbers_of_elements():
    g, t = grid(points=(0, 0.25, 1, 10), nfe=9, ncp=1)
    assert list(t) == pytest.approx([0, 1 / 12, 1 / 6, 0.25, 0.5, 0.75, 1, 4, 7, 10], abs=1e-6)
    assert [len(elements) for elements in g.stages.values()] == [3, 3, 3]


@given(
    st.lists(st.integers(1, 400), min_size=1, max_size=5),
    st.integers(1, 4),
    st.integers(1, 4),
    st.sampled_from(SCHEMES),
)
@settings(max_examples=30, deadline=None)
def test_any_stages_are_found_again(gaps, each, ncp, scheme):
    points = tuple(float(p) for p in np.cumsum([0, *gaps]) / 100)
    g, t = grid(points, nfe=each * len(gaps), ncp=ncp, scheme=scheme)
    assert [len(elements) for elements in g.stages.values()] == [each] * len(gaps)
    for elements, left, right in zip(g.stages.values(), points, points[1:]):
        assert (elements[0].left, elements[-1].right) == (left, right)
        assert [e.opens_stage for e in elements] == [True] + [False] * (each - 1)
        assert [e.length for e in elements] == pytest.approx([(right - left) / each] * each, abs=2e-6)


def test_a_boundary_belongs_to_the_element_on_its_left():
    for scheme in SCHEMES:
        g, t = grid(nfe=2, ncp=2, scheme=scheme)
        owner = g.element_of()
        assert set(owner) == set(t) - {0}
        assert (owner[1.0].n, owner[2].n) == (1, 2)
        assert all(owner[label] is e for e in g.elements for label in e.points)


def test_a_backward_difference_is_one_stage_an_element():
    m = model()
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.t, nfe=4, scheme='BACKWARD')
    g = read_grid(m.t, [0, 2])
    assert (g.tau, g.weights, g.right_is_collocated) == ((1.0,), (1.0,), True)
    assert [e.points for e in g.elements] == [(e.right,) for e in g.elements]


@pytest.mark.parametrize('scheme', ['CENTRAL', 'FORWARD'])
def test_equations_that_join_two_elements_are_refused(scheme):
    m = model()
    pyo.TransformationFactory('dae.finite_difference').apply_to(m, wrt=m.t, nfe=4, scheme=scheme)
    with pytest.raises(FesdError, match='whose equations join two elements'):
        read_grid(m.t, [0, 2])


def test_labels_that_fell_together_are_refused():
    m = model((0, 1e-5))
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=2, ncp=5)
    with pytest.raises(FesdError, match=r'its labels collide at pyomo.dae.s resolution'):
        read_grid(m.t, [0, 1e-5])


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('ncp', NCP)
@pytest.mark.parametrize('horizon', [1e-12, 1e-9, 3.3e-6, 1e-3])
def test_elements_of_any_length_have_labels_of_their_own(horizon, ncp, scheme):
    m = model((0, horizon))
    discretise(m, m.t, [3], ncp, scheme)
    elements = read_grid(m.t, [0, horizon]).elements
    assert [len(e.points) for e in elements] == [ncp] * 3
    assert [e.length for e in elements] == pytest.approx([horizon / 3] * 3, rel=2e-3, abs=0)


def test_labels_of_ordinary_elements_have_the_decimals_of_pyomo():
    assert label_decimals(model((0, 1)).t, [10], 3) == 6


def test_the_shortest_stage_decides_about_the_decimals():
    assert label_decimals(model((0, 1e-5, 10)).t, [2, 2], 2) == 10


def test_elements_beyond_floating_point_are_refused():
    with pytest.raises(FesdError, match='let time begin at 0'):
        label_decimals(model((1e6, 1e6 + 1e-9)).t, [3], 2)


# Quadrature


GRIDS = {(scheme, ncp): grid(nfe=2, ncp=ncp, scheme=scheme)[0] for scheme in SCHEMES for ncp in NCP}


@given(st.sampled_from(sorted(GRIDS)), st.lists(st.floats(-10, 10, allow_subnormal=False), min_size=10, max_size=10))
@settings(max_examples=200, deadline=None)
def test_weights_integrate_polynomials_up_to_the_degree_of_the_scheme(which, coefficients):
    scheme, ncp = which
    degree = 2 * ncp - 2 if scheme == RADAU else 2 * ncp - 1
    polynomial = np.polynomial.Polynomial(coefficients[: degree + 1])
    g = GRIDS[which]
    total = sum(b * polynomial(c) for b, c in zip(g.weights, g.tau))
    assert total == pytest.approx(polynomial.integ()(1), abs=1e-10)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('ncp', NCP)
def test_weights_are_positive_and_of_no_higher_degree(scheme, ncp):
    g = GRIDS[scheme, ncp]
    assert min(g.weights) > 0
    degree = 2 * ncp - 1 if scheme == RADAU else 2 * ncp
    total = sum(b * c**degree for b, c in zip(g.weights, g.tau))
    assert abs(total - 1 / (degree + 1)) > 1e-7


def test_the_weights_of_gauss_are_those_of_the_tables():
    assert GRIDS[LEGENDRE, 3].weights == pytest.approx((5 / 18, 8 / 18, 5 / 18), abs=1e-13)
    assert GRIDS[RADAU, 2].weights == pytest.approx((3 / 4, 1 / 4), abs=1e-13)
