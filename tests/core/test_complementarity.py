"""Complementarity conditions read as pairs, in all forms that users write."""

import pyomo.environ as pyo
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import FesdError
from pyomo_fesd.core.complementarity import Mixed, Pair, read_complementarity, read_side


@pytest.fixture
def m():
    """Free x, y; p >= 0, q >= 0; u <= 4; b in [1, 4]; a mutable Param c = 3."""
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=2), pyo.Var(initialize=5)
    m.p, m.q = pyo.Var(bounds=(0, None), initialize=2), pyo.Var(bounds=(0, None), initialize=5)
    m.u = pyo.Var(bounds=(None, 4), initialize=1)
    m.b = pyo.Var(bounds=(1, 4), initialize=2)
    m.v, m.w = pyo.Var(bounds=(0, 1), initialize=0.5), pyo.Var(bounds=(0, 9), initialize=3)
    m.r = pyo.Var(bounds=(-100, 100), initialize=3)
    m.half = pyo.Var(bounds=(0, float('inf')), initialize=3)
    m.d = pyo.Param(initialize=float('inf'), mutable=True)
    m.c = pyo.Param(initialize=3, mutable=True)
    return m


def condition(m, first, second):
    """The ComplementarityData of ``complements(first, second)``."""
    m.condition = Complementarity(expr=complements(first, second))
    return m.condition


def pair(m, first, second):
    """G and H as text."""
    found = read_complementarity(condition(m, first, second))
    assert isinstance(found, Pair)
    return str(found.G), str(found.H)


@pytest.mark.parametrize(
    'write, G, H',
    [
        (lambda m: (m.x >= 0, m.y >= 0), 'x', 'y'),
        (lambda m: (0 <= m.x, 0 <= m.y), 'x', 'y'),
        (lambda m: (m.x >= 1, m.y >= 0), 'x - 1', 'y'),
        (lambda m: (m.x <= 4, m.y >= 0), '4 - x', 'y'),
        (lambda m: (m.x <= 4, m.y <= 9), '4 - x', '9 - y'),
        (lambda m: (m.x >= m.c, m.y >= 0), 'x - c', 'y'),
        (lambda m: (m.x <= m.c, m.y >= 0), 'c - x', 'y'),
        (lambda m: (m.x >= m.u, m.y >= 0), 'x - u', 'y'),
        (lambda m: (m.x <= m.u, m.y >= 0), 'u - x', 'y'),
        (lambda m: (m.x + m.y >= 0, m.x * m.y >= 0), 'x + y', 'x*y'),
        (lambda m: (m.p, m.q), 'p', 'q'),
        (lambda m: (m.p, m.x >= 0), 'p', 'x'),
        (lambda m: (m.x >= 0, m.p), 'x', 'p'),
        (lambda m: (m.u, m.p), '4 - u', 'p'),
        (lambda m: (m.p, m.x + m.y), 'p', 'x + y'),
        (lambda m: (m.x + m.y, m.p), 'p', 'x + y'),
        (lambda m: (m.x >= 0, m.y), 'x', 'y'),
        (lambda m: (m.u, m.x + m.y), '4 - u', '- (x + y)'),
        (lambda m: (m.x >= 0, m.b), 'x', 'b - 1'),
        (lambda m: (m.b, m.x >= 0), 'x', 'b - 1'),
        (lambda m: (pyo.inequality(0, m.x, 1), m.y >= 0), 'y', 'x'),
        # more bounds than two, where the upper ones make no difference
        (lambda m: (m.v, m.w), 'v', 'w'),
        (lambda m: (m.p, m.b), 'p', 'b - 1'),
        (lambda m: (m.b, m.p), 'b - 1', 'p'),
        # bounds that are none
        (lambda m: (m.half, m.x), 'half', 'x'),
        (lambda m: (pyo.inequality(0, m.x, float('inf')), m.y), 'x', 'y'),
        (lambda m: (pyo.inequality(0, m.x, m.d), m.y), 'x', 'y'),
        (lambda m: (pyo.inequality(float('-inf'), m.x, 4), m.y), '4 - x', '- y'),
    ],
)
def test_a_condition_as_people_write_it_is_a_pair_of_non_negative_sides(m, write, G, H):
    assert pair(m, *write(m)) == (G, H)


@pytest.mark.parametrize(
    'write, lower, body, upper, F',
    [
        (lambda m: (pyo.inequality(0, m.x, 1), m.y), 0, 'x', 1, 'y'),
        (lambda m: (m.y, pyo.inequality(0, m.x, 1)), 0, 'x', 1, 'y'),
        (lambda m: (m.b, m.x + m.y), 1, 'b', 4, 'x + y'),
        (lambda m: (m.x + m.y, m.b), 1, 'b', 4, 'x + y'),
        (lambda m: (pyo.inequality(m.c, m.x, 8), m.y - 1), 3, 'x', 8, 'y - 1'),
        (lambda m: (m.v, m.x), 0, 'v', 1, 'x'),
        (lambda m: (pyo.inequality(0, m.v, 1), m.r), 0, 'v', 1, 'r'),
        (lambda m: (m.r, pyo.inequality(0, m.v, 1)), 0, 'v', 1, 'r'),
        (lambda m: (m.x <= float('inf'), pyo.inequality(0, m.y, 1)), 0, 'y', 1, 'x'),
    ],
)
def test_two_bounds_on_one_side_are_a_mixed_condition(m, write, lower, body, upper, F):
    found = read_complementarity(condition(m, *write(m)))
    assert isinstance(found, Mixed)
    assert (pyo.value(found.lower), str(found.body), pyo.value(found.upper), str(found.F)) == (lower, body, upper, F)


@pytest.mark.parametrize(
    'write, cause',
    [
        (lambda m: (m.x == 0, m.y >= 0), "one side is an equality, 'x  ==  0'"),
        (lambda m: (m.y >= 0, m.x == m.y), 'one side is an equality'),
        (lambda m: (m.x, m.y), "'x' and 'y' have 0 finite bounds between them, two are needed"),
        (lambda m: (m.x + 1, m.y), 'have 0 finite bounds'),
        (lambda m: (pyo.inequality(0, m.x, 1), pyo.inequality(0, m.y, 1)), 'have 4 finite bounds'),
        # which of them is between its bounds, and which has to vanish there?
        (lambda m: (m.v, m.r), 'have 4 finite bounds'),
        (lambda m: (m.r, m.v), 'have 4 finite bounds'),
        (lambda m: (m.b, m.u), 'have 3 finite bounds'),
    ],
)
def test_what_is_no_condition_is_refused_with_its_sides(m, write, cause):
    data = condition(m, *write(m))
    with pytest.raises(FesdError) as error:
        read_complementarity(data)
    assert error.value.component == 'condition' and cause in error.value.cause


def test_an_empty_condition_is_refused():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(bounds=(0, None))
    m.c = Complementarity([1, 2])
    data = m.c.add(1, complements(m.x, m.x + 1))
    data._args = None
    with pytest.raises(FesdError, match=r'^c\[1\]: this complementarity condition is empty'):
        read_complementarity(data)


def test_reading_adds_nothing_to_the_model(m):
    data = condition(m, m.x + m.y >= 1, m.p)
    before = [c.name for c in m.component_data_objects()]
    read_complementarity(data)
    assert [c.name for c in m.component_data_objects()] == before


def test_bounds_that_change_later_are_read_as_they_are_then(m):
    data = condition(m, m.x >= m.c, m.p)
    m.c = 7
    m.p.setlb(1)
    G, H = read_complementarity(data)
    assert (pyo.value(G), str(H)) == (2 - 7, 'p - 1')


def test_fixed_variables_stay_variables(m):
    m.u.fix(1)
    m.x.fix(2)
    G, H = read_complementarity(condition(m, m.x >= m.u, m.y >= 0))
    m.u.fix(0)
    assert pyo.value(G) == 2


def test_a_rule_over_an_index_is_read_at_each_index():
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1, 2], bounds=(0, None))
    m.c = Complementarity([1, 2], rule=lambda m, i: complements(m.x[i] >= i, 3 - m.x[i] >= 0))
    assert [tuple(map(str, read_complementarity(m.c[i]))) for i in (1, 2)] == [('x[1] - 1', '3 - x[1]'), ('x[2] - 2', '3 - x[2]')]


@pytest.mark.parametrize(
    'write, lower, body, upper',
    [
        (lambda m: m.x >= 1, 1, 'x', None),
        (lambda m: m.x <= 1, None, 'x', 1),
        (lambda m: m.x >= m.y, 0, 'x - y', None),
        (lambda m: pyo.inequality(0, m.x, 1), 0, 'x', 1),
        (lambda m: m.b, 1, 'b', 4),
        (lambda m: m.x, None, 'x', None),
        (lambda m: m.x * m.y, None, 'x*y', None),
        (lambda m: 5, None, '5', None),
    ],
)
def test_one_side_by_itself(m, write, lower, body, upper):
    found = read_side(write(m))
    assert (found.lower, str(found.body), found.upper) == (lower, body, upper)


NUMBERS = st.floats(-5, 5)


@given(NUMBERS, NUMBERS, NUMBERS, NUMBERS, st.booleans(), st.booleans())
def test_a_pair_is_as_far_from_its_bounds_as_the_inequalities_say(x, y, first, second, below, above):
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=x), pyo.Var(initialize=y)
    one = m.x >= first if below else m.x <= first
    two = m.y >= second if above else m.y <= second
    G, H = read_complementarity(condition(m, one, two))
    assert pyo.value(G) == pytest.approx(x - first if below else first - x, abs=1e-12)
    assert pyo.value(H) == pytest.approx(y - second if above else second - y, abs=1e-12)


@pytest.mark.parametrize('F, holds', [(1.0, 0.0), (-1.0, 4.0)])
def test_a_one_sided_mixed_condition_gives_the_free_side_its_sign(F, holds):
    # at a lower bound F >= 0, at an upper bound F <= 0: both bounds of one solved problem
    m = pyo.ConcreteModel()
    m.v = pyo.Var(bounds=(0, None) if F > 0 else (None, 4), initialize=1)
    m.c = Complementarity(expr=complements(m.v, m.v - holds + F))
    m.cost = pyo.Objective(expr=(m.v - 2) ** 2)
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    pyo.assert_optimal_termination(results)
    assert min(abs(m.v.value - holds), abs(m.v.value - holds + F)) <= 1e-7
