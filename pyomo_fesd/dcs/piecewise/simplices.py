"""Piecewise linear functions of several arguments that jump from one simplex to the next: Stewart's form (theory, eq. 3).

With heights that make the triangulation the lower side of a convex function (``regular_triangulation.py``), the simplex of x is
the one whose plane a_i^T x + b_i is the largest, so

    g_i(x) = -(a_i^T x + b_i)        and        y = sum_i nu_i f_i(x)

Takes: a ``PiecewiseLinearFunction`` of several arguments that depend on time.
Leaves: Stewart's form (``core/smallest.py``) over time and simplex, and ``domain``, the sides of the domain that bounds do not
    imply.
Does not apply: to continuous functions, which need fewer variables by their vertices (``multivariate.py``).
"""

from pyomo.contrib.fbbt.expression_bounds_walker import ExpressionBoundsVisitor
from pyomo.core import Constraint, RangeSet

from pyomo_fesd.core import add_smallest, declare_smallest
from pyomo_fesd.dcs.piecewise.generated_blocks import delete_data


def call(function, text, triangulation, args, context):
    """Return the value of ``function``, ``text`` in words, by the multipliers of its simplices."""
    nu = _simplex_weights(text, triangulation, args, context)
    return sum(nu_i * f(*args) for nu_i, f in zip(nu, function._linear_functions))


def _simplex_weights(text, triangulation, args, context):
    """nu of every simplex; the existing ones where the arguments are the same."""
    blocks, time, key = context.shared.interpolations, context.time, (text, triangulation.key)
    block = blocks.existing(time, args, key)
    if block is not None:
        return [block.nu[time, i] for i in block.regions]
    block, x, facets = blocks.new(time, args, text, key), triangulation.local(args), triangulation.facets()
    if block.component('domain') is None:
        declare_smallest(block, (blocks.wrt,), len(triangulation.simplices))
        block.sides = RangeSet(len(facets))
        block.domain = Constraint(blocks.wrt, block.sides)
    blocks.undo.callback(delete_data, block, (time,))
    for k, facet in enumerate(facets, start=1):
        _keep_inside(block, (time, k), _affine(facet, x))
    return add_smallest(block, (time,), [-_affine(plane, x) for plane in triangulation.planes])


def _keep_inside(block, index, side):
    """Impose side <= 0 where the bounds of its variables do not imply it."""
    largest = ExpressionBoundsVisitor().walk_expression(side)[1]
    if largest is None or largest > 0:
        block.domain.add(index, side <= 0)


def _affine(coefficients, x):
    """c^T x + e."""
    *c, e = map(float, coefficients)
    return sum(c_j * x_j for c_j, x_j in zip(c, x) if c_j) + e
