"""Piecewise linear functions of one argument (theory, eq. 8), with jumps (eq. 5).

    y(x) = y_0 + m_0 (x - x_0) + sum_k (m_k - m_{k-1}) s_k + sum_k J_k alpha_k,    s_k = max(0, x - b_k)

with slopes m_k between the breakpoints b_k and jumps J_k.  A breakpoint without jump costs the variable and the pair of s_k; at a
jump alpha_k is the step function of x - b_k, whose positive part a change of slope there uses.  A breakpoint at which nothing
changes leaves nothing.

Takes: ``Piecewise`` over time, and ``PiecewiseLinearFunction`` of one argument that depends on time.
Leaves: the expression of y; x is kept between the first and the last breakpoint where its bounds do not imply that.
Does not apply: where Pyomo itself has found that linear inequalities suffice (a convex lower or a concave upper bound).
"""

from dataclasses import dataclass
from typing import NamedTuple

from pyomo.contrib.fbbt.expression_bounds_walker import ExpressionBoundsVisitor
from pyomo.core import SOSConstraint, Var, value
from pyomo.core.base.piecewise import Bound, PiecewiseData

from pyomo_fesd.core import FesdError

#: Relative change of a slope below which it has not changed.
FLAT = 1e-10
#: Rounding error of a value of the function, relative to the terms that it is made of.
ROUNDING = 1e-14
#: Deviation of a function on a segment from linear, relative to its values, that is taken for rounding.
LINEAR = 1e-9

#: kind of a Piecewise -> its relation between y and the expression
RELATIONS = {
    Bound.Equal: lambda y, f: y == f,
    Bound.Lower: lambda y, f: y >= f,
    Bound.Upper: lambda y, f: y <= f,
}


@dataclass(frozen=True)
class PiecewiseLinear:
    """The numbers of eq. (8).

    Attributes
    ----------
    lower, upper : float
        the ends of its domain; x_0 is ``lower``
    y_0, m_0 : float
    breaks : tuple of (b_k, J_k, m_k - m_{k-1})
        where it jumps or changes its slope
    """

    lower: float
    upper: float
    y_0: float
    m_0: float
    breaks: tuple

    def expression(self, x, context):
        """Return y(x) in one context."""
        _keep_inside(x, self.lower, self.upper, context)
        y = self.y_0 + self.m_0 * (x - self.lower) if self.m_0 else self.y_0
        for level, jump, change in self.breaks:
            # the jump first: a change of slope uses its positive part
            if jump:
                y += jump * context.indicator(x, level)
            if change:
                y += change * context.positive_part(x, level)
        return y


class _Segment(NamedTuple):
    """The function between two neighbouring breakpoints, from the value ``start`` to ``end``."""

    left: float
    right: float
    start: float
    end: float

    @property
    def slope(self):
        return (self.end - self.start) / (self.right - self.left)

    @property
    def rounding(self):
        """Rounding error of its values, also where they come from slope and intercept."""
        terms = (self.start, self.end, self.slope * self.left, self.slope * self.right)
        return ROUNDING * max(map(abs, terms))


def piecewise_linear(source, points, values) -> PiecewiseLinear:
    """Return the function through the points in order; two values at one point are a jump.

    Raises
    ------
    FesdError
        for three values at one point, and where all points are the same
    """
    points, values = [float(value(p)) for p in points], [float(value(y)) for y in values]
    _refuse_points(source, points)
    segments = [_Segment(*ends) for ends in zip(points, points[1:], values, values[1:]) if ends[0] < ends[1]]
    first, last = segments[0], segments[-1]
    changes = [_change(a, b) for a, b in zip(segments, segments[1:])]
    ends = (first.left, first.start - values[0], 0.0), (last.right, values[-1] - last.end, 0.0)
    breaks = tuple(b for b in (ends[0], *changes, ends[1]) if any(b[1:]))
    return PiecewiseLinear(first.left, last.right, values[0], first.slope, breaks)


def _refuse_points(source, points):
    tripled = [x for x, z in zip(points, points[2:]) if x == z]
    if tripled or points[0] == points[-1]:
        raise FesdError(
            source,
            f"it has more than two values at the breakpoint {tripled[0]}" if tripled else "its breakpoints are all the same",
            "give each breakpoint once, or twice with the values before and after a jump",
        )


def _change(before, after):
    """b_k, J_k and m_k - m_{k-1} between two neighbouring segments; 0 where they differ by rounding only."""
    rounding = max(before.rounding, after.rounding)
    jump, change = after.start - before.end, after.slope - before.slope
    flat = FLAT * max(abs(before.slope), abs(after.slope)) + rounding / min(s.right - s.left for s in (before, after))
    return after.left, jump if abs(jump) > rounding else 0.0, change if abs(change) > flat else 0.0


def _of_function(function):
    """The numbers of a PiecewiseLinearFunction of one argument.

    Raises
    ------
    FesdError
        where its segments leave a gap or overlap, or where a function on them is not linear
    """
    ends = [sorted(function._points[k][0] for k in simplex) for simplex in function._simplices]
    points, values = [], []
    for (left, right), f in sorted(zip(ends, function._linear_functions), key=lambda segment: segment[0]):
        start, middle, end = (float(value(f(x))) for x in (left, (left + right) / 2, right))
        segment = _Segment(left, right, start, end)
        if points and points[-1] != left:
            raise FesdError(
                function,
                f"its segments {'leave a gap' if left > points[-1] else 'overlap'} between {min(points[-1], left)} and "
                f"{max(points[-1], left)}",
                "let each segment begin where another one ends",
            )
        if abs(middle - (start + end) / 2) > LINEAR * max(abs(start), abs(end), segment.rounding / ROUNDING):
            raise FesdError(
                function,
                f"its function between {left} and {right} is not linear",
                "give linear functions; write a curved function as a Disjunction or an Expr_if",
            )
        points += [left, right]
        values += [start, end]
    return piecewise_linear(function, points, values)


def _keep_inside(x, lower, upper, context):
    """Impose lower <= x <= upper where the bounds of x do not imply it; outside, the function is undefined."""
    least, largest = ExpressionBoundsVisitor().walk_expression(x)
    if least is None or least < lower or largest is None or largest > upper:
        context.keep_inside(x, lower, upper)


def call(node, args, context):
    """Return the value of a PiecewiseLinearFunction of one argument."""
    (x,) = args
    return _of_function(node.pw_linear_function).expression(x, context)


def is_piecewise(block) -> bool:
    """Whether a block is a Piecewise that Pyomo has not written by linear constraints alone."""
    return isinstance(block, PiecewiseData) and any(c.ctype in (Var, SOSConstraint) for c in block.component_map().values())


def relation(source, context):
    """Return the equation or inequality that a Piecewise states."""
    x, y = source.referenced_variables()
    function = piecewise_linear(source, source._domain_pts, source._range_pts)
    return RELATIONS[source._bound_type](y, function.expression(x, context))
