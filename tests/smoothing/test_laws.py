"""Laws: at complementary s, generated expressions have the value of numpy's max, min, abs and clip."""

import numpy as np
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyomo_fesd import absolute, clip, maximum, minimum
from tests.smoothing.support import exact, settle, smooth_abs, smooth_max, smooth_min

NUMBERS = st.sampled_from([-2.0, -1.0, 0.0, 0.5, 1.0, 3.0])

# One way to write each function: (max, min, abs, clip)
NUMPY = (np.maximum, np.minimum, np.abs, np.clip)


def helpers(block):
    """The public functions, on one block."""
    return tuple(lambda *args, f=f: f(block, *args) for f in (maximum, minimum, absolute, clip))


def smoothed(eps):
    """As IDAES writes them, of expressions; numbers are not smoothed."""

    def of(smooth, limit):
        return lambda *args: limit(*args) if all(isinstance(a, float) for a in args) else smooth(*args, eps)

    largest, smallest = of(smooth_max, max), of(smooth_min, min)
    return largest, smallest, of(smooth_abs, abs), lambda z, low, high: smallest(largest(z, low), high)


def with_abs():
    """By abs() alone."""
    largest, smallest = (lambda a, b: (a + b + abs(a - b)) / 2), (lambda a, b: (a + b - abs(a - b)) / 2)
    return largest, smallest, abs, lambda z, low, high: smallest(largest(z, low), high)


@st.composite
def trees(draw, depth=2):
    """A function (ways, x, y) -> value or expression, made of nonsmooth terms and of sums, products and multiples."""
    if depth == 0:
        c = draw(NUMBERS)
        return draw(st.sampled_from([lambda w, x, y: x, lambda w, x, y: y, lambda w, x, y: c]))
    a, b = draw(trees(depth=depth - 1)), draw(trees(depth=depth - 1))
    low = draw(NUMBERS)
    high = low + abs(draw(NUMBERS))
    return draw(
        st.sampled_from(
            [
                lambda w, x, y: w[0](a(w, x, y), b(w, x, y)),
                lambda w, x, y: w[1](a(w, x, y), b(w, x, y)),
                lambda w, x, y: w[2](a(w, x, y)),
                lambda w, x, y: w[3](a(w, x, y), low, high),
                lambda w, x, y: a(w, x, y) - 2 * b(w, x, y),
                lambda w, x, y: a(w, x, y) * b(w, x, y),
            ]
        )
    )


POINTS = st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4)), min_size=3, max_size=3)
BOUNDS = st.sampled_from([(None, None), (0, None), (None, 0), (-1, 2)])


def model(bounds):
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=0, bounds=bounds), pyo.Var(initialize=-0.7)
    m.v = pyo.Var(initialize=0)
    return m


def agree(m, expression, tree, points, bounds):
    """Whether ``expression`` has numpy's value at the points that the bounds allow."""
    low, high = (-np.inf if bounds[0] is None else bounds[0]), (np.inf if bounds[1] is None else bounds[1])
    for x, y in points:
        x = float(np.clip(x, low, high))
        m.x.value, m.y.value = x, y
        settle(m)
        assert pyo.value(expression) == pytest.approx(float(tree(NUMPY, x, y)), rel=1e-9, abs=1e-9)


@settings(max_examples=80, deadline=None)
@given(trees(), POINTS, BOUNDS)
def test_the_functions_have_the_values_of_numpy(tree, points, bounds):
    m = model(bounds)
    agree(m, tree(helpers(m), m.x, m.y), tree, points, bounds)


@settings(max_examples=80, deadline=None)
@given(trees(), POINTS, BOUNDS, st.sampled_from(['idaes', 'no eps', 'abs']))
def test_the_transformation_gives_the_values_of_numpy(tree, points, bounds, way):
    m = model(bounds)
    ways = {'idaes': smoothed(1e-4), 'no eps': smoothed(0.0), 'abs': with_abs()}[way]
    m.c = pyo.Constraint(expr=m.v == tree(ways, m.x, m.y))
    exact(m)
    agree(m, m.c.expr.args[1] if m.c.expr.args[0] is m.v else -m.c.body, tree, points, bounds)
    assert exact(m).replaced == 0
