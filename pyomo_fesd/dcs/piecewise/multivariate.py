"""Piecewise linear functions of several arguments over a triangulation.

With heights phi_v that make the triangulation the lower side of a convex function (``regular_triangulation.py``), the point x is
the convex combination, with weights w, of the vertices of its own simplex exactly if w solves

    min phi^T w    subject to    sum_v w_v v = x,    sum_v w_v = 1,    w >= 0

With a and b, the multipliers of the equations, the optimality conditions of this linear program are

    phi_v - a^T v - b - lam_v = 0,    0 <= w_v  perp  lam_v >= 0        and        y = sum_v w_v y_v

The weights are continuous where x is, and so is y.  x cannot leave the domain.  Stewart's program (``simplices.py``) has a pair for
each simplex, of which there are more than vertices: twice as many in the plane, six times in space.

Takes: a ``PiecewiseLinearFunction`` of several arguments that depend on time.
Leaves: ``w``, ``lam``, ``slope`` (a, then b), ``stationarity``, ``combination`` and ``complementarity`` over time and vertex, once
    for all functions with the same simplices and arguments; coordinates v are those of the unit cube around the domain.
Does not apply: to functions that jump from one simplex to the next (``simplices.py``); to triangulations that are not regular.
"""

from functools import partial

import numpy as np
from pyomo.core import Constraint, RangeSet, Var, value
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import Dependents, FesdError, switched_systems, value_or_nan
from pyomo_fesd.dcs.piecewise import simplices
from pyomo_fesd.dcs.piecewise.generated_blocks import delete_data
from pyomo_fesd.dcs.piecewise.regular_triangulation import RegularTriangulation

#: Difference of a function's values, relative to the largest of them, that is taken for rounding.
ROUNDING = 1e-9


def call(node, args, context):
    """Return the value of a PiecewiseLinearFunction of several arguments."""
    function = node.pw_linear_function
    triangulation = context.shared.once(RegularTriangulation, _triangulation(function), function)
    values = _values(function, triangulation)
    blocks = context.shared.interpolations
    text = f'{blocks.name(function)}({", ".join(map(blocks.text, args))})'
    if values is None:
        return simplices.call(function, text, triangulation, args, context)
    return sum(w * y for w, y in zip(_vertex_weights(text, triangulation, args, context), values) if y)


def _triangulation(function):
    """Vertices and simplices as nested tuples of numbers, without vertices that belong to no simplex."""
    used = sorted({int(v) for simplex in function._simplices for v in simplex})
    number = {v: k for k, v in enumerate(used)}
    vertices = tuple(tuple(float(value(x)) for x in function._points[v]) for v in used)
    return vertices, tuple(tuple(number[int(v)] for v in simplex) for simplex in function._simplices)


def _values(function, triangulation):
    """y_v of every vertex; None where the functions on two simplices disagree.

    Raises
    ------
    FesdError
        where a function is not linear
    """
    points, members = np.array(triangulation.vertices), np.array(triangulation.simplices)
    simplices_and_functions = list(zip(points[members], function._linear_functions))
    corners = np.array([[value(f(*x)) for x in simplex] for simplex, f in simplices_and_functions], dtype=float)
    rounding = ROUNDING * np.abs(corners).max()
    for (simplex, f), mean in zip(simplices_and_functions, corners.mean(axis=1)):
        if abs(mean - value(f(*simplex.mean(axis=0)))) > rounding:
            where = ', '.join(str(tuple(map(float, x))) for x in simplex)
            raise FesdError(
                function,
                f"its function on the simplex of {where} is not linear",
                "give linear functions; write a curved function as a Disjunction",
            )
    found = {}
    if any(abs(found.setdefault(v, y) - y) > rounding for v, y in zip(members.flat, corners.flat)):
        return None
    return [float(found[v]) for v in range(len(points))]


def _vertex_weights(text, triangulation, args, context):
    """w of every vertex; the existing ones where the arguments are the same."""
    blocks, time, key = context.shared.interpolations, context.time, triangulation.key
    block = blocks.existing(time, args, key)
    if block is None:
        block = blocks.new(time, args, text, key)
        if block.component('w') is None:
            _declare_triangulation(block, blocks.wrt, triangulation)
        blocks.undo.callback(delete_data, block, (time,))
        _add_optimality_conditions(block, time, triangulation, args)
    return [block.w[time, k] for k in block.vertices]


def _declare_triangulation(block, wrt, triangulation):
    block.vertices, block.rows = RangeSet(len(triangulation.vertices)), RangeSet(len(triangulation.size) + 1)
    block.w = Var(wrt, block.vertices, dense=False, bounds=(0, None))
    block.lam = Var(wrt, block.vertices, dense=False, bounds=(0, None))
    block.slope = Var(wrt, block.rows, dense=False)
    block.stationarity = Constraint(wrt, block.vertices)
    block.combination = Constraint(wrt, block.rows)
    block.complementarity = Complementarity(wrt, block.vertices)
    switched_systems(block).continuous[block.w] = block.arguments


def _add_optimality_conditions(block, time, triangulation, args):
    """Add the optimality conditions at one time, starting from the present values of the arguments."""
    now = [value_or_nan(x) for x in args]
    now = now if np.isfinite(now).all() else triangulation.corner
    simplex, corners = triangulation.at(now)[0], _corners(triangulation)
    for k, column, x in zip(block.rows, corners.T, (*triangulation.local(args), 1)):
        combined = sum(float(c) * block.w[time, v] for c, v in zip(column, block.vertices) if c)
        block.combination.add((time, k), combined == x)
    slope = [block.slope[time, k] for k in block.rows]
    for v, height, corner in zip(block.vertices, triangulation.heights, corners):
        plane = sum(c * a for c, a in zip(corner, slope) if c)
        block.stationarity.add((time, v), height - plane - block.lam[time, v] == 0)
        block.complementarity.add((time, v), complements(block.w[time, v] >= 0, block.lam[time, v] >= 0))
    # as many as there are slopes: with them the others are determined too
    switched_systems(block).selectors.update(block.lam[time, v + 1] for v in simplex)
    variables = (*(block.w[time, v] for v in block.vertices), *slope, *(block.lam[time, v] for v in block.vertices))
    for variable, number in zip(variables, _optimal_values(triangulation, now)):
        variable.value = number
    dependents = Dependents(variables, tuple(args), partial(_optimal_values, triangulation))
    switched_systems(block).dependents.append(dependents)


def _corners(triangulation):
    """A row for each vertex: its coordinates, and 1 for the sum of the weights."""
    return np.column_stack([triangulation.unit, np.ones(len(triangulation.unit))])


def _optimal_values(triangulation, arguments):
    """Values of w, slope and lam at values of the arguments."""
    _, w, slope = triangulation.at(np.array(arguments))
    lam = np.maximum(0.0, triangulation.heights - _corners(triangulation) @ slope)
    return [float(number) for number in (*w, *slope, *lam)]
