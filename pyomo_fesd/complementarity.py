"""What a Pyomo ``Complementarity`` says, as pairs of expressions ``0 <= G perp H >= 0``.

``pyomo.mpec`` keeps the user's two arguments as they were written (``_args``); its own standard form adds a variable and an
equation to every condition and refuses forms that people write.  Here the arguments are only read, nothing is added.
"""

from math import inf
from typing import NamedTuple

from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import value
from pyomo.core.expr import EqualityExpression, InequalityExpression, RangedExpression

from pyomo_fesd.errors import FesdError


class Side(NamedTuple):
    """One argument of a condition: ``lower <= body <= upper``, None for no bound."""

    lower: object
    body: object
    upper: object


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
        """Distance from the lower bound."""
        return _difference(self.body, self.lower)

    @property
    def below(self):
        """Distance from the upper bound."""
        return _difference(self.upper, self.body)


def _is_constant(expr):
    return expr.__class__ in native_numeric_types or not expr.is_potentially_variable()


def _difference(a, b):
    """``a - b`` without a trailing ``- 0``; a mutable Param stays, its value may change."""
    return a if b.__class__ in native_numeric_types and b == 0 else a - b


def _finite(bound):
    """``bound``, or None if it is infinite: no bound."""
    if bound is None or not _is_constant(bound):
        return bound
    return None if abs(value(bound, exception=False) or 0) == inf else bound


def side(arg):
    """Read one argument of ``complements``.

    A relational expression gives its own bounds; a bare variable gives the bounds that it was declared with, so that
    ``complements(x, y)`` of two non-negative variables means what it says.  An infinite bound is none.
    """
    if arg.__class__ in native_numeric_types:
        return Side(None, arg, None)
    if isinstance(arg, RangedExpression):
        low, body, high = arg.args
        return Side(_finite(low), body, _finite(high))
    if isinstance(arg, InequalityExpression):
        low, high = arg.args
        if _is_constant(low):
            return Side(_finite(low), high, None)
        if _is_constant(high):
            return Side(None, low, _finite(high))
        return Side(0, high - low, None)
    if isinstance(arg, EqualityExpression):
        return Side(0, arg.args[0] - arg.args[1], 0)
    if arg.is_variable_type():
        return Side(_finite(arg.lower), arg, _finite(arg.upper))
    return Side(None, arg, None)


def _gap(s):
    """The non-negative distance of a side to its only bound."""
    return _difference(s.body, s.lower) if s.upper is None else _difference(s.upper, s.body)


def gap(arg, where):
    """``arg`` as one expression that must not be negative: the distance to its bound if it is an inequality."""
    if not isinstance(arg, (EqualityExpression, InequalityExpression, RangedExpression)):
        return arg
    s = side(arg)
    if isinstance(arg, EqualityExpression) or (s.lower is None) == (s.upper is None):
        raise FesdError(where, f"'{arg}' is not one inequality", "write c >= 0, or each bound by itself")
    return _gap(s)


def _lower_gap(s):
    """The same where a second bound is only a bound."""
    return _gap(s) if s.lower is None else _difference(s.body, s.lower)


def read(data):
    """The meaning of one ComplementarityData.

    Bounds that the condition itself states come first; declared bounds of bare variables fill what is missing to two.  Where
    more than two are declared, an upper bound is taken for a bound and nothing else, if that makes no difference.

    Returns
    -------
    Pair or Mixed

    Raises
    ------
    FesdError
        for an empty condition, an equality as a side, or sides that do not have two finite bounds between them (counting, for
        a bare variable, its declared bounds).
    """
    args = getattr(data, '_args', None)
    if args is None:
        raise FesdError(data, "this complementarity condition is empty", "give it a rule, or delete the index")
    for arg in args:
        if isinstance(arg, EqualityExpression):
            raise FesdError(data, f"one side is an equality, '{arg}'", "write the equality as a Constraint of its own")
    sides = [side(a) for a in args]
    stated = [isinstance(a, (InequalityExpression, RangedExpression)) for a in args]
    counts = [(s.lower is not None) + (s.upper is not None) for s in sides]
    if counts == [1, 1]:
        return Pair(_gap(sides[0]), _gap(sides[1]))
    for i, j in ((0, 1), (1, 0)):
        if counts[i] == 2 and (counts[j] == 0 or (stated[i] and not stated[j])):
            return Mixed(sides[i].lower, sides[i].body, sides[i].upper, sides[j].body)
        if counts[i] == 1 and counts[j] == 0:
            # one-sided mixed condition: the free side takes the sign that the bound gives it
            F = sides[j].body
            return Pair(_gap(sides[i]), F if sides[i].upper is None else -F)
        if counts[i] == 1 and counts[j] == 2 and stated[i]:
            # a bound stated on one side, two bounds on the other: only its lower bound can be meant
            return Pair(_gap(sides[i]), _lower_gap(sides[j]))
        if counts[i] == 2 and counts[j] and not any(stated) and _never_negative(sides[j], counts[j], sides[i]):
            # l <= x <= u  perp  y  is the same as  x - l  perp  y  where y >= 0
            return Pair(_lower_gap(sides[0]), _lower_gap(sides[1]))
    raise FesdError(
        data,
        f"the two sides '{args[0]}' and '{args[1]}' have {sum(counts)} finite bounds between them, two are needed",
        "write complements(G >= 0, H >= 0), or give the bare variables their bounds"
        if sum(counts) < 2
        else "state the two that are meant: complements(G >= 0, H >= 0), or complements(inequality(l, x, u), F)",
    )


def _never_negative(s, count, other):
    """Whether the bare variable of a side begins at zero; if both have two bounds, whether both do."""
    return _is_zero(s.lower) and (count == 1 or _is_zero(other.lower))


def _is_zero(bound):
    return bound is not None and _is_constant(bound) and value(bound, exception=False) == 0
