"""Piecewise linear functions of several arguments: the simplex of a point by a linear program."""

import itertools
from math import exp, log

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyomo.contrib.piecewise import PiecewiseLinearFunction, Triangulation
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

import pyomo_fesd
from pyomo_fesd import FesdError
from pyomo_fesd.core.time_index import TimeIndex
from pyomo_fesd.dcs.piecewise.regular_triangulation import RegularTriangulation
from pyomo_fesd.finite_elements.continuity import read_continuity
from tests.models import collocate, dcs, snapshot
from tests.problems.running import run, solve, transform

GRID = [(x, y) for x in (0.0, 1.0, 2.0) for y in (0.0, 1.0, 2.0)]


def bowl(x, y):
    return 1 + x**2 + y**2 + x * y


def line(function, start=(0.2, 0.1), rates=(1.5, 0.7), end=1.0, highest=2.0):
    """x and y run along a straight line, J collects the function along it."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    m.x, m.y = (pyo.Var(m.t, bounds=(0, highest), initialize=now) for now in start)
    m.J = pyo.Var(m.t, initialize=0.0)
    m.dx, m.dy, m.dJ = (dae.DerivativeVar(v) for v in (m.x, m.y, m.J))
    for v, now in zip((m.x, m.y, m.J), (*start, 0.0)):
        v[0].fix(now)
    m.f = function
    m.run_x = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == rates[0])
    m.run_y = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == rates[1])
    m.collect = pyo.Constraint(m.t, rule=lambda m, t: m.dJ[t] == m.f(m.x[t], m.y[t]))
    return m


def collected(function, start=(0.2, 0.1), rates=(1.5, 0.7), end=1.0):
    """J at the end, and the times at which the line leaves a simplex, in closed form."""
    points = np.array(function._points, dtype=float)
    times = {0.0, end}
    for simplex in function._simplices:
        for p, q in itertools.combinations(points[list(simplex)], 2):
            normal = np.array([-(q - p)[1], (q - p)[0]])
            if abs(speed := normal @ rates) > 1e-12:
                t = normal @ (p - start) / speed
                s = (start + t * np.array(rates) - p) @ (q - p) / ((q - p) @ (q - p))
                if 0 < t < end and -1e-9 <= s <= 1 + 1e-9:
                    times.add(round(float(t), 12))
    times = sorted(times)
    middles = [np.array(start) + (a + b) / 2 * np.array(rates) for a, b in zip(times, times[1:])]
    return sum((b - a) * function(*x) for a, b, x in zip(times, times[1:], middles)), times[1:-1]


def generated(m, ctype):
    return [c for c in m.component_data_objects(ctype, descend_into=pyo.Block) if '_pyomo_fesd_meshes.' in c.name]


def counts(m):
    """Generated variables, constraints and pairs at one time."""
    return [len(generated(m, ctype)) / len(m.t) for ctype in (pyo.Var, pyo.Constraint, Complementarity)]


# The mesh


def triangulation(points, simplices=None):
    simplices = Delaunay(points).simplices if simplices is None else simplices
    return RegularTriangulation((tuple(map(tuple, points)), tuple(tuple(map(int, s)) for s in simplices)), None)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([2, 3]))
def test_the_weights_of_the_linear_program_are_those_of_the_own_simplex(seed, dimension):
    random = np.random.default_rng(seed)
    points = random.uniform(-3, 5, (10, dimension)) * 10.0 ** random.integers(-3, 4, dimension)
    tri, own = Delaunay(points), triangulation(points)
    for x in random.dirichlet(np.ones(10), 5) @ points:
        _, w, slope = own.at(x)
        assert w.min() >= 0 and w.sum() == pytest.approx(1) and w @ points == pytest.approx(x)
        lam = own.heights - own.unit @ slope[:-1] - slope[-1]
        assert lam.min() > -1e-9 and np.abs(w * lam).max() < 1e-9
        assert w @ np.arange(10.0) == pytest.approx(LinearNDInterpolator(tri, np.arange(10.0))(x).item())


def test_the_simplices_of_a_grid_are_told_apart():
    own = triangulation(np.array(GRID))
    for simplex in own.simplices:
        middle = np.array(GRID)[list(simplex)].mean(axis=0)
        found, _, slope = own.at(middle)
        assert sorted(found) == sorted(simplex)
        lam = own.heights - own.unit @ slope[:-1] - slope[-1]
        assert lam[[v for v in range(9) if v not in simplex]].min() > 1e-3


@pytest.mark.parametrize('kind', [Triangulation.J1, Triangulation.OrderedJ1, Triangulation.Delaunay])
def test_all_of_pyomos_triangulations_are_regular(kind):
    points = [(x, y) for x in range(5) for y in range(5)]
    m = pyo.ConcreteModel()
    m.f = PiecewiseLinearFunction(points=points, function=bowl, triangulation=kind)
    own = triangulation([tuple(map(float, p)) for p in m.f._points], m.f._simplices)
    assert own.heights.shape == (25,)


# Its size


def test_a_vertex_costs_two_variables_an_equation_and_a_pair():
    # and three slopes, three equations for the point
    m = dcs(line(PiecewiseLinearFunction(points=GRID, function=bowl)))
    assert counts(m) == [2 * 9 + 3, 9 + 3, 9]


def test_functions_on_the_same_mesh_share_it():
    m = line(PiecewiseLinearFunction(points=GRID, function=bowl))
    m.g = PiecewiseLinearFunction(points=GRID, function=lambda x, y: x - y**2)
    m.z = pyo.Var(m.t)
    m.other = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == m.g(m.x[t], m.y[t]) + m.f(m.x[t], m.y[t]))
    dcs(m)
    assert counts(m) == [2 * 9 + 3, 9 + 3, 9]
    assert list(m._pyomo_fesd_meshes.component_map()) == ['f_x_y']


def test_other_arguments_have_weights_of_their_own():
    m = line(PiecewiseLinearFunction(points=GRID, function=bowl))
    m.z = pyo.Var(m.t)
    m.other = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == m.f(m.y[t], m.x[t]) + m.f(m.x[t], 1.5))
    assert counts(dcs(m))[2] == 3 * 9


def test_the_value_is_continuous_in_time():
    m = line(PiecewiseLinearFunction(points=GRID, function=bowl))
    m.z = pyo.Var(m.t)
    m.other = pyo.Constraint(m.t, rule=lambda m, t: m.z[t] == m.f(m.x[t], m.y[t]))
    dcs(collocate(m))
    t = m.t.at(2)
    assert read_continuity(m, TimeIndex(m.t), {t}, (), [], trace=True).holds(m.z[t])


# Whole paths


WRITINGS = {
    'points and function': lambda: PiecewiseLinearFunction(points=GRID, function=bowl),
    'table': lambda: PiecewiseLinearFunction(tabular_data={p: bowl(*p) for p in GRID}),
    'J1': lambda: PiecewiseLinearFunction(points=GRID, function=bowl, triangulation=Triangulation.J1),
}


@pytest.mark.parametrize('write', WRITINGS.values(), ids=WRITINGS.keys())
@pytest.mark.parametrize('scheme', ['LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE'])
def test_along_a_line_the_function_is_collected_exactly(write, scheme):
    m = run(line(write()), 8, 2, scheme=scheme)
    end, times = collected(m.f)
    assert m.J[1].value == pytest.approx(end, abs=1e-8)
    boundaries = list(pyomo_fesd.element_lengths(m)['end'])
    assert len(times) >= 2 and all(min(abs(b - t) for b in boundaries) < 1e-7 for t in times)


@pytest.mark.parametrize(
    'start, rates',
    [((0.2, 1), (1.5, 0)), ((0, 0), (1.5, 1.5)), ((0.2, 0), (1.5, 0)), ((0.3, 2), (1.5, 0))],
    ids=['side of a simplex', 'diagonal', 'lower side of the domain', 'upper side of the domain'],
)
def test_along_a_side_of_simplices_the_function_is_collected_exactly(start, rates):
    m = run(line(PiecewiseLinearFunction(points=GRID, function=bowl), start, rates), 8, 2)
    assert m.J[1].value == pytest.approx(collected(m.f, start, rates)[0], abs=1e-9)


def test_a_discretised_model_gives_the_same():
    m = dcs(collocate(line(PiecewiseLinearFunction(points=GRID, function=bowl)), 8, 2))
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m)
    assert solve(m).J[1].value == pytest.approx(collected(m.f)[0], abs=1e-8)


def test_three_arguments():
    # of the six simplices around the diagonal of a cube, those where z <= x are passed: f = x + y there
    m = line(PiecewiseLinearFunction(points=GRID, function=bowl))
    m.collect.deactivate()
    order = {p: [(0, 0, 0), *np.cumsum(np.eye(3, dtype=int)[list(p)], axis=0).tolist()] for p in itertools.permutations(range(3))}
    simplices = [tuple(map(tuple, s)) for s in order.values()]
    m.g = PiecewiseLinearFunction(simplices=simplices, function=lambda x, y, z: x + y - (1 - x) * z)
    m.also = pyo.Constraint(m.t, rule=lambda m, t: m.dJ[t] == m.g(m.x[t] / 2, m.y[t] / 2, 0.3))
    run(m, 8, 2)
    # g at (x, y, z) is x + y - max(0, z - x), by the corners
    x, met = 0.1, (0.3 - 0.1) / 0.75
    integral = 0.1 + 0.375 + 0.05 + 0.175 - met * (0.3 - x) / 2
    assert m.J[1].value == pytest.approx(integral, abs=1e-8)


def test_an_argument_may_jump(caplog):
    """A controller switches the second argument over; the first is the state."""
    m = line(
        PiecewiseLinearFunction(points=[(x, u) for x in (0, 1, 6) for u in (0, 0.5, 2)], function=lambda x, u: 1 + 2 * u + x),
        highest=6,
    )
    for c in (m.run_x, m.run_y, m.collect):
        c.deactivate()
    m.u = pyo.Var(m.t, bounds=(0, 2), initialize=0.5)
    m.controller = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 1.5, m.u[t] == 0.3], [m.x[t] >= 1.5, m.u[t] == 1.2]])
    m.rise = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f(m.x[t], m.u[t]))
    run(m, 8, 3)
    # dx = 1.6 + x up to 1.5, then 3.4 + x
    met = log(3.1 / 1.8)
    assert m.x[1].value == pytest.approx(4.9 * exp(1 - met) - 3.4, abs=1e-6)
    assert 'neither side is known to be continuous' in caplog.text


def test_x_cannot_leave_the_domain():
    m = line(PiecewiseLinearFunction(points=GRID, function=bowl), rates=(3.0, 0.7), highest=None)
    transform(m, 4, 2)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, max_iterations=300)
    assert not pyo.check_optimal_termination(results)


# Functions that jump


def cliff():
    """1 left of the diagonal y = x, 0.5 right of it."""
    left, right = ((0, 0), (0, 2), (2, 2)), ((0, 0), (2, 0), (2, 2))
    return PiecewiseLinearFunction(simplices=[left, right], linear_functions=[lambda x, y: 1 + 0 * x, lambda x, y: 0.5 + 0 * x])


def test_a_function_that_jumps_is_chosen_by_its_simplices():
    m = dcs(line(cliff()))
    # nu, lam, mu; the sides of the domain are bounds already
    assert counts(m) == [5, 3, 2]
    m = line(cliff(), highest=3)
    m.again = pyo.Constraint(m.t, rule=lambda m, t: m.f(m.x[t], m.y[t]) <= 2)
    assert counts(dcs(m)) == [5, 5, 2]


def test_across_a_jump_the_function_is_collected_exactly():
    m = run(line(cliff(), start=(0.1, 0.3)), 6, 2)
    # the diagonal is met at 0.25
    assert m.J[1].value == pytest.approx(0.25 * 1 + 0.75 * 0.5, abs=1e-9)


def test_at_a_jump_it_may_slide():
    m = line(cliff(), start=(0.2, 0.1))
    m.run_x.deactivate()
    m.climb = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f(m.x[t], m.y[t]))
    run(m, 6, 2)
    # right of the diagonal dx = 0.5 < dy = 0.7: met at 0.5; left of it dx = 1 > dy
    assert min(abs(b - 0.5) for b in pyomo_fesd.element_lengths(m)['end']) < 1e-9
    assert m.x[1].value == pytest.approx(m.y[1].value, abs=1e-9)


# What is refused


def twisted():
    """The smallest triangulation that is not regular: a triangle turned in a triangle."""
    A, B, C, a, b, c = (4, 0), (0, 4), (0, 0), (2, 1), (1, 2), (1, 1)
    simplices = [(a, b, c), (A, B, b), (A, b, a), (B, C, c), (B, c, b), (C, A, a), (C, a, c)]
    return PiecewiseLinearFunction(simplices=simplices, function=lambda x, y: x * y)


def with_hole():
    return PiecewiseLinearFunction(simplices=[((0, 0), (2, 0), (0, 2)), ((2, 2), (2, 1), (1, 2))], function=bowl)


def overlapping():
    return PiecewiseLinearFunction(simplices=[((0, 0), (2, 0), (0, 2)), ((0, 0), (2, 0), (2, 2))], function=bowl)


def curved():
    left, right = ((0, 0), (0, 2), (2, 2)), ((0, 0), (2, 0), (2, 2))
    return PiecewiseLinearFunction(simplices=[left, right], linear_functions=[lambda x, y: x * y, lambda x, y: x])


@pytest.mark.parametrize(
    'write, cause',
    [(twisted, 'is not regular'), (with_hole, 'leave holes'), (overlapping, 'overlap'), (curved, 'is not linear')],
)
def test_what_is_refused_is_named_and_the_model_is_as_it_was(write, cause):
    m = line(write())
    before = snapshot(m)
    with pytest.raises(FesdError, match=cause) as error:
        dcs(m)
    assert error.value.component == 'f'
    assert snapshot(m) == before
