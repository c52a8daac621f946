"""The check of the MPCC study recognises B-stationary points of any method; its runner reads methods and options."""

import math

import pytest
from benchmarks.mpcc.b_stationarity import check
from benchmarks.mpcc.instance import Instance
from benchmarks.mpcc.worker import read_options, split_methods

X, Y = [0, [0], [1]], [0, [1], [1]]


def instance(obj, comp, nodes=(), con=(), sense='min', lb=(-math.inf, -math.inf)):
    """Two variables, an mpcc-json dict as its reader loads it."""
    return Instance(
        {'n': 2, 'lb': list(lb), 'ub': [math.inf] * 2, 'nodes': nodes, 'obj': obj, 'con': con, 'comp': comp, 'sense': sense}
    )


def distance_to(a, b):
    """(x - a)^2 + (y - b)^2 as objective and nodes."""
    return [0, [-2, -4], [1, 1]], [['a', -a, [0], [1]], ['p', -1, 2], ['a', -b, [1], [1]], ['p', -3, 2]]


@pytest.mark.parametrize('point, expected', [((0, 0), False), ((1, 0), True), ((0, 1), True), ((0.5, 0), False)])
def test_corner_pulled_into_both_branches(point, expected):
    obj, nodes = distance_to(1, 1)
    verdict = check(instance(obj, [['pair', X, Y]], nodes), point)
    assert verdict.b_stationary is expected
    assert verdict.binaries == int(point == (0, 0))


def test_origin_whose_multipliers_have_both_signs_but_where_all_branches_ascend():
    # min 2x - y, x >= 0, 0 <= y perp y - x >= 0
    found = check(instance([0, [0, 1], [2, -1]], [['pair', Y, [0, [0, 1], [-1, 1]]]], lb=(0, -math.inf)), (0, 0))
    assert found.b_stationary and found.value == 0 and found.binaries == 1


def test_maximising_reverses_the_objective():
    assert check(instance([0, [0, 1], [-1, -1]], [['pair', X, Y]], sense='max'), (0, 0)).b_stationary
    assert not check(instance([0, [0, 1], [1, -1]], [['pair', X, Y]], sense='max'), (0, 0)).b_stationary


@pytest.mark.parametrize(
    'slope, point, expected',
    # 0 <= x <= 2 perp y: y >= 0 at 0, y <= 0 at 2, y = 0 between; min slope' (x, y)
    [
        ((1, 1), (0, 0), True),
        ((-1, 1), (0, 0), False),
        ((1, -1), (0, 0), False),
        ((-1, -1), (2, 0), True),
        ((-1, 1), (2, 0), False),
        ((0, 1), (1, 0), True),
        ((1, 0), (1, 0), False),
        ((0, 1), (0, 1), False),
    ],
)
def test_condition_between_two_bounds(slope, point, expected):
    assert check(instance([0, [0, 1], slope], [['mcp', 0, 2, X, Y]]), point).b_stationary is expected


@pytest.mark.parametrize(
    'lower, upper, slope, point, expected',
    [
        (None, None, (0, 1), (0, 0), True),  # y = 0, x free
        (None, None, (1, 0), (0, 0), False),
        (0, 0, (1, 0), (0, 5), True),  # x = 0, y free
        (0, 0, (0, 1), (0, 5), False),
        (None, 2, (-1, -1), (2, 0), True),  # y <= 0 at x = 2
        (None, 2, (-1, 1), (2, 0), False),
    ],
)
def test_condition_with_one_bound_none_or_equal_ones(lower, upper, slope, point, expected):
    assert check(instance([0, [0, 1], slope], [['mcp', lower, upper, X, Y]]), point).b_stationary is expected


def test_inexact_point_near_a_solution_is_stationary():
    # ralph2, x^2 + y^2 - 4 x y: the origin is the solution, Scholtes' relaxation ends at x = y = sqrt(eps)
    nodes = [['p', 0, 2], ['p', 1, 2], ['*', 0, 1]]
    ralph2 = instance([0, [-1, -2, -3], [1, 1, -4]], [['pair', X, Y]], nodes)
    found = check(ralph2, (1e-3, 1e-3))
    assert found.b_stationary and found.moved == pytest.approx(1e-3)


def test_inexact_point_near_a_corner_with_descent_is_not_stationary():
    obj, nodes = distance_to(1, 1)
    assert check(instance(obj, [['pair', X, Y]], nodes), (1e-4, 1e-4)).b_stationary is False


@pytest.mark.parametrize(
    'text, methods',
    [
        ('hybrid,scholtes', ['hybrid', 'scholtes']),
        ('hybrid;hybrid:relaxation=l1', ['hybrid', 'hybrid:relaxation=l1']),
        ('hybrid:lpec=full,starts=8,product', ['hybrid:lpec=full,starts=8', 'product']),
    ],
)
def test_methods_are_separated_from_their_options(text, methods):
    assert split_methods(text) == methods


def test_options_of_a_method():
    assert read_options('hybrid') == {}
    assert read_options('hybrid:lpec=full,starts=8,eps_init=0.5') == {'lpec': 'full', 'starts': 8, 'eps_init': 0.5}
    assert read_options('hybrid:nlp_solver=asl:ipopt') == {'nlp_solver': 'asl:ipopt'}
    with pytest.raises(ValueError, match="unknown method: schotes"):
        read_options('schotes')
