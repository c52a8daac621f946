"""Read a Pyomo ``Complementarity`` as a pair of expressions ``0 <= G perp H >= 0``, or as a mixed condition.

``pyomo.mpec`` keeps the user's two arguments as they were written (``_args``); its own standard form adds a variable and an
equation to every condition and refuses forms that users write.  Here the arguments are only read.
"""

from math import inf
from typing import NamedTuple

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core.expr import EqualityExpression, InequalityExpression, RangedExpression

from pyomo_fesd.core.errors import FesdError
from pyomo_fesd.core.evaluation import value_or_nan


class Side(NamedTuple):
    """One argument of a condition: ``lower <= body <= upper``, None for no bound."""

    lower: object
    body: object
    upper: object

    @property
    def bounds(self) -> int:
        """Number of bounds."""
        return (self.lower is not None) + (self.upper is not None)

    @property
    def distance(self):
        """Distance of ``body`` from the lower bound, or from the upper bound if it is the only one."""
        return _difference(self.upper, self.body) if self.lower is None else _difference(self.body, self.lower)


class Pair(NamedTuple):
    """``0 <= G perp H >= 0`` (theory, eq. 14)."""

    G: object
    H: object


class Mixed(NamedTuple):
    """``lower <= body <= upper  perp  F``: F >= 0 at the lower bound, F <= 0 at the upper, F = 0 between."""

    lower: object
    body: object
    upper: object
    F: object

    @property
    def above(self):
        """Distance of ``body`` from the lower bound."""
        return _difference(self.body, self.lower)

    @property
    def below(self):
        """Distance of ``body`` from the upper bound."""
        return _difference(self.upper, self.body)


def _is_constant(expr):
    return expr.__class__ in native_numeric_types or not expr.is_potentially_variable()


def _difference(a, b):
    """``a - b`` without a trailing ``- 0``; a mutable Param stays, its value may change."""
    return a if b.__class__ in native_numeric_types and b == 0 else a - b


def _finite(bound):
    """``bound``, or None if it is infinite."""
    if bound is None or not _is_constant(bound):
        return bound
    number = bound if bound.__class__ in native_numeric_types else value_or_nan(bound)
    return None if abs(number) == inf else bound


def read_side(arg) -> Side:
    """Read one argument of ``complements``.

    A relational expression gives its own bounds; a bare variable gives the bounds that it was declared with, so that
    ``complements(x, y)`` of two non-negative variables means x >= 0, y >= 0.  Infinite bounds are left out.
    """
    if arg.__class__ in native_numeric_types:
        return Side(None, arg, None)
    if isinstance(arg, RangedExpression):
        low, body, high = arg.args
        return Side(_finite(low), body, _finite(high))
    if isinstance(arg, InequalityExpression):
        return _read_inequality(*arg.args)
    if isinstance(arg, EqualityExpression):
        return Side(0, arg.args[0] - arg.args[1], 0)
    if arg.is_variable_type():
        return Side(_finite(arg.lower), arg, _finite(arg.upper))
    return Side(None, arg, None)


def _read_inequality(low, high):
    if _is_constant(low):
        return Side(_finite(low), high, None)
    if _is_constant(high):
        return Side(None, low, _finite(high))
    return Side(0, high - low, None)


def distance_to_bound(arg, where):
    """Return ``arg`` as one expression that must not be negative: the distance to its bound if it is an inequality.

    Raises
    ------
    FesdError
        for an equality, and for an inequality with two bounds or none
    """
    if not isinstance(arg, (EqualityExpression, InequalityExpression, RangedExpression)):
        return arg
    side = read_side(arg)
    if isinstance(arg, EqualityExpression) or side.bounds != 1:
        raise FesdError(where, f"'{arg}' is not one inequality", "write c >= 0, or each bound by itself")
    return side.distance


def read_complementarity(data) -> Pair | Mixed:
    """Read one ComplementarityData.

    Bounds that the condition itself states come first; declared bounds of bare variables complete them to two.  Where more than
    two are declared, an upper bound of a variable remains its bound and takes no part in the condition, if that is equivalent.

    Raises
    ------
    FesdError
        for an empty condition, an equality as a side, or sides that do not have two finite bounds between them (counting, for
        a bare variable, its declared bounds).
    """
    args = _arguments(data)
    # most conditions are generated, and there is one at every time: the rest takes longer than to read them
    G, H = map(_stated_above_zero, args)
    if G is not None and H is not None:
        return Pair(G, H)
    sides = [read_side(arg) for arg in args]
    stated = [isinstance(arg, (InequalityExpression, RangedExpression)) for arg in args]
    for i, j in ((0, 1), (1, 0)):
        first, second = sides[i], sides[j]
        if _is_pair(first, second, stated[i], stated[j]):
            return Pair(first.distance, second.distance)
        if _is_mixed(first, second, stated[i], stated[j]):
            return Mixed(*first, second.body)
        if first.bounds == 1 and second.bounds == 0:
            # a mixed condition with one bound: the free side takes the sign that the bound gives it
            return Pair(first.distance, second.body if first.upper is None else -second.body)
    bounds = sides[0].bounds + sides[1].bounds
    raise FesdError(
        data,
        f"the two sides '{args[0]}' and '{args[1]}' have {bounds} finite bounds between them, two are needed",
        "write complements(G >= 0, H >= 0), or give the bare variables their bounds"
        if bounds < 2
        else "state the two that are meant: complements(G >= 0, H >= 0), or complements(inequality(l, x, u), F)",
    )


def _stated_above_zero(arg):
    """The body of an argument that reads ``0 <= body``, of a number that cannot change, else None."""
    if arg.__class__ is not InequalityExpression:
        return None
    low, body = arg.args
    return body if low.__class__ in native_numeric_types and low == 0 else None


def _arguments(data):
    args = getattr(data, '_args', None)
    if args is None:
        raise FesdError(data, "this complementarity condition is empty", "give it a rule, or delete the index")
    for arg in args:
        if isinstance(arg, EqualityExpression):
            raise FesdError(data, f"one side is an equality, '{arg}'", "write the equality as a Constraint of its own")
    return args


def _is_pair(first, second, first_stated, second_stated):
    """Whether the condition means one bound of each side: the only one, or the lower one."""
    bounds = first.bounds, second.bounds
    if bounds == (1, 1) or first_stated or second_stated:
        return bounds == (1, 1) or (first_stated and bounds == (1, 2))
    return all(bounds) and _lower_bounds_suffice(first, second)


def _lower_bounds_suffice(first, second):
    """l <= x <= u  perp  y  is  x - l  perp  y  where y >= 0; with two bounds each, both variables must begin at zero."""
    tested = [s for s in (first, second) if s.bounds == 1] or [first, second]
    return all(_is_zero(s.lower) for s in tested)


def _is_mixed(first, second, first_stated, second_stated):
    return first.bounds == 2 and (second.bounds == 0 or (first_stated and not second_stated))


def _is_zero(bound):
    return bound is not None and _is_constant(bound) and value_or_nan(bound) == 0
