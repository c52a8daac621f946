"""Piecewise linear functions of several arguments that jump from one simplex to the next: Stewart's form (theory, eq. 3).

With heights that make the triangulation the lower side of a convex function (mesh.py), the simplex of x is the one whose plane
a_i^T x + b_i is the largest, so

    g_i(x) = -(a_i^T x + b_i)        and        y = sum_i nu_i f_i(x)

Takes: a ``PiecewiseLinearFunction`` of several arguments that depend on time.
Leaves: Stewart's form (stewart.py) over time and simplex, and ``domain``, the sides of the domain that bounds do not imply.
Does not apply: to functions that are continuous, which cost less by their vertices (multivariate.py).
"""

from pyomo.contrib.fbbt.expression_bounds_walker import ExpressionBoundsVisitor
from pyomo.core import Constraint, RangeSet
from pyomo.core.expr.compare import compare_expressions

from pyomo_fesd.dcs import stewart
from pyomo_fesd.dcs.home import forget


def choose(function, text, mesh, args, place):
    """The value of ``function``, ``text`` in words, by the multipliers of its simplices."""
    nu = _weights(text, mesh, args, place)
    return sum(n * f(*args) for n, f in zip(nu, function._linear_functions))


def _weights(text, mesh, args, place):
    """nu of every simplex; those that are there already, where the arguments are the same."""
    home, time = place.shared.meshes, place.time
    for known, block in home.entries(time):
        if block.doc == text and all(map(compare_expressions, args, known)):
            return [block.nu[time, i] for i in block.regions]
    block, x = home.new(time, args, text), mesh.local(args)
    if block.component('nu') is None:
        stewart.declare(block, (home.wrt,), len(mesh.simplices))
        block.sides = RangeSet(len(mesh.facets()))
        block.domain = Constraint(home.wrt, block.sides)
    home.undo.callback(forget, block, (time,))
    for k, side in zip(block.sides, (_affine(facet, x) for facet in mesh.facets())):
        largest = ExpressionBoundsVisitor().walk_expression(side)[1]
        if largest is None or largest > 0:
            block.domain.add((time, k), side <= 0)
    return stewart.minimise(block, (time,), [-_affine(plane, x) for plane in mesh.planes])


def _affine(coefficients, x):
    """c^T x + e."""
    *c, e = map(float, coefficients)
    return sum(c_j * x_j for c_j, x_j in zip(c, x) if c_j) + e
