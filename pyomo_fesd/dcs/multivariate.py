"""Piecewise linear functions of several arguments over a triangulation.

With heights phi_v that make the triangulation the lower side of a convex function (mesh.py), the point x is the convex
combination, with weights w, of the vertices of its own simplex exactly if w solves

    min phi^T w    subject to    sum_v w_v v = x,    sum_v w_v = 1,    w >= 0

With a and b, the multipliers of the equations, the optimality conditions of this linear program are

    phi_v - a^T v - b - lam_v = 0,    0 <= w_v  perp  lam_v >= 0        and        y = sum_v w_v y_v

The weights are continuous where x is, and so is y.  x cannot leave the domain.  Stewart's program (simplices.py) has a pair for
each simplex, of which there are more than vertices: twice as many in the plane, six times in space.

Takes: a ``PiecewiseLinearFunction`` of several arguments that depend on time.
Leaves: ``w``, ``lam``, ``slope`` (a, then b), ``stationarity``, ``combination`` and ``complementarity`` over time and vertex, once
    for all functions with the same simplices and arguments; coordinates v are those of the unit cube around the domain.
Does not apply: to functions that jump from one simplex to the next (simplices.py); to triangulations that are not regular.
"""

import numpy as np
from pyomo.common.autoslots import AutoSlots
from pyomo.core import Block, Constraint, RangeSet, Var, value
from pyomo.core.expr.compare import compare_expressions
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.dcs import simplices
from pyomo_fesd.dcs.home import forget
from pyomo_fesd.dcs.mesh import Mesh
from pyomo_fesd.dcs.regions import value_now
from pyomo_fesd.errors import FesdError

#: Difference of a function's values, relative to the largest of them, that is taken for rounding.
ROUNDING = 1e-9


class _Triangulation(AutoSlots.Mixin):
    """Private data of the block of a mesh: its vertices and simplices."""

    __slots__ = ('triangulation',)

    def __init__(self):
        self.triangulation = None


Block.register_private_data_initializer(_Triangulation, scope='pyomo_fesd.dcs.multivariate')


def call(node, args, place):
    """The value of a PiecewiseLinearFunction of several arguments."""
    function = node.pw_linear_function
    mesh = place.shared.once(Mesh, _triangulation(function), function)
    values = _values(function, mesh)
    home = place.shared.meshes
    text = f'{home.name(function)}({", ".join(map(home.text, args))})'
    if values is None:
        return simplices.choose(function, text, mesh, args, place)
    return sum(w * y for w, y in zip(_weights(text, mesh, args, place), values) if y)


def _triangulation(function):
    """Vertices and simplices as nested tuples of numbers, without vertices that belong to no simplex."""
    used = sorted({int(v) for simplex in function._simplices for v in simplex})
    number = {v: k for k, v in enumerate(used)}
    vertices = tuple(tuple(float(value(x)) for x in function._points[v]) for v in used)
    return vertices, tuple(tuple(number[int(v)] for v in simplex) for simplex in function._simplices)


def _values(function, mesh):
    """y_v of every vertex; None where the functions on two simplices disagree.

    Raises
    ------
    FesdError
        where a function is not linear
    """
    points, members = np.array(mesh.vertices), np.array(mesh.simplices)
    pieces = list(zip(members, function._linear_functions))
    corners = np.array([[value(f(*x)) for x in points[simplex]] for simplex, f in pieces], dtype=float)
    middles = [value(f(*points[simplex].mean(axis=0))) for simplex, f in pieces]
    rounding = ROUNDING * np.abs(corners).max()
    for (simplex, _), mean, middle in zip(pieces, corners.mean(axis=1), middles):
        if abs(mean - middle) > rounding:
            where = ', '.join(str(tuple(map(float, x))) for x in points[simplex])
            raise FesdError(
                function,
                f"its function on the simplex of {where} is not linear",
                "give linear functions; curved pieces belong into a Disjunction",
            )
    found = {}
    if any(abs(found.setdefault(v, y) - y) > rounding for v, y in zip(members.flat, corners.flat)):
        return None
    return [float(found[v]) for v in range(len(points))]


def _weights(text, mesh, args, place):
    """w of every vertex; those that are there already, where the arguments are the same."""
    home, time = place.shared.meshes, place.time
    for known, block in home.entries(time):
        if _triangulation_of(block) == mesh.triangulation and all(map(compare_expressions, args, known)):
            return [block.w[time, k] for k in block.vertices]
    block = home.new(time, args, text)
    if block.component('w') is None:
        _declare(block, home.wrt, mesh)
    home.undo.callback(forget, block, (time,))
    _add(block, time, mesh, args)
    return [block.w[time, k] for k in block.vertices]


def _triangulation_of(block):
    return block.private_data('pyomo_fesd.dcs.multivariate').triangulation


def _declare(block, wrt, mesh):
    block.private_data('pyomo_fesd.dcs.multivariate').triangulation = mesh.triangulation
    block.vertices, block.rows = RangeSet(len(mesh.vertices)), RangeSet(len(mesh.size) + 1)
    block.w = Var(wrt, block.vertices, dense=False, bounds=(0, None))
    block.lam = Var(wrt, block.vertices, dense=False, bounds=(0, None))
    block.slope = Var(wrt, block.rows, dense=False)
    block.stationarity = Constraint(wrt, block.vertices)
    block.combination = Constraint(wrt, block.rows)
    block.complementarity = Complementarity(wrt, block.vertices)
    marks.mark(block, marks.CONTINUOUS, block.w, block.arguments)


def _add(block, time, mesh, args):
    """Add the optimality conditions at one time, starting from the present values of the arguments."""
    now = [value_now(x) for x in args]
    simplex, w, slope = mesh.at(mesh.corner if None in now else now)
    for k, a in zip(block.rows, slope):
        block.slope[time, k].value = a
        block.combination.add((time, k), _combined(block, time, mesh, k - 1) == _right_hand_side(args, mesh, k - 1))
    for v, k in enumerate(block.vertices):
        lam, plane = block.lam[time, k], sum(c * block.slope[time, r] for c, r in zip((*mesh.unit[v], 1.0), block.rows) if c)
        block.w[time, k].value = w[v]
        lam.value = max(0.0, mesh.heights[v] - value(plane))
        block.stationarity.add((time, k), mesh.heights[v] - plane - lam == 0)
        block.complementarity.add((time, k), complements(block.w[time, k] >= 0, lam >= 0))
    for v in simplex:
        # as many as there are slopes: with them the others are given too
        marks.mark(block, marks.SELECTOR, block.lam[time, v + 1])


def _combined(block, time, mesh, axis):
    """sum_v w_v v in one direction; sum_v w_v after the last one."""
    column = mesh.unit[:, axis] if axis < len(mesh.size) else np.ones(len(mesh.unit))
    return sum(float(c) * block.w[time, k] for c, k in zip(column, block.vertices) if c)


def _right_hand_side(args, mesh, axis):
    return mesh.local(args)[axis] if axis < len(mesh.size) else 1
