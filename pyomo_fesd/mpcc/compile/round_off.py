"""Constants that are left where the terms of fixed values cancel.

A row such as c(x(0)) - level = lam_p - lam_n has no other constant where x(0) is fixed.  On the surface or near it, this is small
or round-off, and shows nothing: the size of lam is that of the terms that cancel.  Round-off is 0, because no point satisfies a row
without it in a branch that fixes both lam.

Takes: rows whose constants are part of their bounds, and the constraints they come from.
Leaves: bounds without round-off, and the sizes of the terms.
Does not apply: to constants of nonlinear rows, which stay in their functions.
"""

from itertools import chain

import numpy as np
from pyomo.core import value
from pyomo.core.expr.visitor import identify_variables
from pyomo.repn import generate_standard_repn

from pyomo_fesd.core import gradient, mutable_parameters

#: Constants below this part of the terms that cancel in them are rounding errors.
EXACT = 1e-13
#: Larger constants show sizes that need no factor, and no tolerance is below them.
TELLING = 1e-3


def without_round_off(constraints, lbg: np.ndarray, ubg: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the bounds of rows with 0 in place of round-off, and the sizes of the terms that cancel in small ones, else 0.

    ``constraints`` are the rows' components, or have the same methods.
    """
    bounds = np.array([lbg, ubg], dtype=float)
    small, sizes = (bounds != 0) & (np.abs(bounds) < TELLING), np.zeros(bounds.shape[1])
    for i in np.flatnonzero(small.any(axis=0)).tolist():
        terms = np.array(_terms(constraints[i]))
        bounds[small[:, i] & (np.abs(bounds[:, i]) <= EXACT * terms), i] = 0.0
        sizes[i] = terms[small[:, i]].max()
    return bounds[0], bounds[1], sizes


def _terms(constraint):
    """Sizes of the terms of fixed values in the lower and in the upper bound of a row; 0 for those that are not part of it."""
    lower, body, upper = constraint.to_bounded_expression()
    if not any(v.fixed for v in identify_variables(body)) and not any(True for _ in mutable_parameters(constraint.expr)):
        return 0.0, 0.0
    repn = generate_standard_repn(body, compute_values=False, quadratic=False)
    if repn.nonlinear_expr is not None:
        return 0.0, 0.0
    of_body = _size(repn.constant)
    return [0.0 if bound is None else _size(bound) + of_body for bound in (lower, upper)]


def _size(expr):
    """The size of the terms of an expression of fixed values: sum of |df/dv v|, 0 without a derivative; of a number its own."""
    if not hasattr(expr, 'is_expression_type'):
        return abs(expr)
    values = list(chain(identify_variables(expr), mutable_parameters(expr)))
    try:
        slopes = gradient(expr, values)
    except NotImplementedError:
        return 0.0
    size = sum(abs(slope * value(v)) for slope, v in zip(slopes, values))
    return size if np.isfinite(size) else 0.0
