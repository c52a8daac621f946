"""Functions that a mode evaluates only where it holds: ``sqrt(c)``, ``c**1.5``, ``log(c + 1)``, ``1/(c + 1)`` in the region c >= 0.

The blended equation (theory, eq. 7) contains the right-hand sides of all modes at all times, so each needs a value outside of its
own region, too.  Which one does not matter.  A function is *restricted* if its argument e has to lie in a domain, here stated as
sides s e + o >= 0.  Where the region implies a side, with the conditions c_k >= 0 of the mode,

    s e + o = sum_k a_k c_k + b,   a_k >= 0,  b >= 0     at every point, or
    s e + o = r (sum_k a_k c_k + b)                      a product with such a factor, or
    s e + o >= 0  inside,  s e + o + sum_k a_k max(0, -c_k) >= 0  outside     at random points

the factors a_k say how to continue e outside (``dcs/continuation.py``).  They are read at random points, but whatever their
values, the continued law is the user's inside the region.
"""

from dataclasses import dataclass
from math import prod

import numpy as np
from pyomo.common.collections import ComponentSet
from pyomo.core.expr.visitor import identify_variables
from scipy.optimize import nnls

from pyomo_fesd.core import FesdError, known_sign, value_or_nan
from pyomo_fesd.dcs.reading.restricted_functions import SIDES, arguments_of, factors_of, has_variables, split
from pyomo_fesd.dcs.sampling import start_of, values_kept

#: Functions whose first or second derivative is infinite at the boundary of their domain.
STEEP = ('sqrt', 'acosh', 'power')
#: Random points, and how many of them must lie inside the region, and outside, to show that it implies a side.
POINTS, SHOWN = 120, 8
#: Relative accuracy of an affine relation.
EXACT = 1e-9


@dataclass(frozen=True)
class Law:
    """How one right-hand side, or one equation of an implicit mode, is continued outside of the region.

    Attributes
    ----------
    domains : tuple of tuples of Side
        for each of ``arguments_of`` the expression
    rest : Side or None
        of an implicit equation: the terms without defined variables have one sign in the region, as in q**2 == k*(h1 - h2)
    """

    domains: tuple = ()
    rest: 'Side | None' = None


@dataclass(frozen=True)
class Side:
    """One side s e + o >= 0 of a domain that the region implies.

    Attributes
    ----------
    sign, offset : numbers
        s and o; of the factor, where there is one
    position : int or None
        of the factor of the product e that is continued (``factors_of``), None for the whole argument
    factors : tuple of (int, float)
        the numbers k of the conditions with a_k > 0
    """

    sign: int
    offset: float
    position: int | None
    factors: tuple


def read_laws(modes, equations, conditions: list) -> list:
    """Return the ``Law`` of each right-hand side (or of each equation of an implicit mode), by mode.

    Parameters
    ----------
    equations : ModeEquations
    conditions : list of lists of (int, expression)
        of each mode, as of ``DomainReader``

    Raises
    ------
    FesdError
        as ``DomainReader.read``
    """
    readers = [DomainReader(mode, c) for mode, c in zip(modes, conditions)]
    return [
        [reader.implicit(con.body - con.upper, equations.defined) for con in equations.equations[i]]
        if equations.is_implicit(i)
        else [Law() if _is_shared(equations, j) else Law(reader.read(f_j)) for j, f_j in enumerate(f)]
        for i, (reader, f) in enumerate(zip(readers, equations.rhs))
    ]


def _is_shared(equations, j):
    """Whether all modes have the same right-hand side, which is not blended then."""
    return len(equations.alike[j]) == 1


class DomainReader:
    """Finds which domains the region of one mode implies.

    Parameters
    ----------
    mode : Mode
        for messages
    conditions : list of (int, expression)
        numbers and expressions of the c_k >= 0
    """

    def __init__(self, mode, conditions: list):
        self._mode, self._conditions = mode, conditions

    def read(self, expression) -> tuple:
        """Return for each of ``arguments_of(expression)`` a tuple of ``Side``: empty where it needs no continuation.

        Raises
        ------
        FesdError
            where the region contradicts the domain, or where a function is undefined at the start and the region does not help
        """
        return tuple(self._sides(*found) for found in arguments_of(expression)) if self._conditions else ()

    def implicit(self, body, defined) -> Law:
        """Return the law of an equation ``body == 0`` in which the ``defined`` variables are nonlinear.

        Raises
        ------
        FesdError
            as ``read``
        """
        own, rest = split(body, defined)
        for sign in (1, -1) if self._conditions and has_variables(rest) else ():
            factors, _ = self._combination(sign * rest)
            if factors:
                return Law(self.read(own), Side(sign, 0.0, None, factors))
        return Law(self.read(body))

    def _sides(self, node, kind, argument):
        found = [side for s, o in SIDES[kind] if (side := self.side(argument, s, o, kind in STEEP)) is not None]
        if kind == 'reciprocal':
            return tuple(found[:1])
        if len(found) < len(SIDES[kind]) and not all(known_sign(s * argument + o) > 0 for s, o in SIDES[kind]):
            self._refuse_undefined(node, kind, argument)
        return tuple(found)

    def side(self, argument, sign, offset, steep=False) -> Side | None:
        """Return how to continue the side ``sign * argument + offset >= 0``.

        None if the region does not imply it, or if bounds imply it already; a function that is ``steep`` at 0 is continued all the
        same where 0 lies on the boundary of the region.
        """
        e = sign * argument + offset
        factors, rest = self._combination(e)
        bounded = known_sign(e) > 0
        if factors and (not bounded or (steep and rest == 0)):
            return Side(sign, offset, None, factors)
        if factors or bounded:
            return None
        return (self._in_product(argument, sign) if offset == 0 else None) or self._enough(e, sign, offset)

    def _in_product(self, argument, sign):
        """The side by a factor of ``argument`` that the region keeps at one sign, where the others have theirs at present."""
        parts = factors_of(argument)
        for position, factor in enumerate(parts) if len(parts) > 1 else ():
            others = value_or_nan(prod(part for k, part in enumerate(parts) if k != position))
            own = -sign if others < 0 else sign
            factors, _ = self._combination(own * factor) if has_variables(factor) else ((), 0.0)
            if factors:
                return Side(own, 0.0, position, factors)
        return None

    def _sample(self, e):
        """Values of ``e`` and of the conditions at random points where both are defined, shapes (points,) and (points, conditions).

        Variables of the conditions take either sign, the others keep theirs.
        """
        expressions, random, rows = [e, *(c for _, c in self._conditions)], np.random.default_rng(1), []
        crossing = ComponentSet(v for _, c in self._conditions for v in identify_variables(c, include_fixed=True))
        with values_kept(expressions) as variables:
            ranges = [_range(v, v in crossing) for v in variables]
            for _ in range(POINTS):
                for v, (middle, spread) in zip(variables, ranges):
                    v.set_value(middle + spread * random.uniform(-1, 1), skip_validation=True)
                rows.append([value_or_nan(expression) for expression in expressions])
        values = np.array(rows)
        values = values[np.isfinite(values).all(axis=1)]
        return values[:, 0], values[:, 1:]

    def _combination(self, e):
        """The factors and b with e = sum_k a_k c_k + b; no factors if there are none."""
        E, C = self._sample(e)
        size = np.abs(E).max(initial=0.0)
        if len(E) < SHOWN or not np.ptp(E):
            return (), 0.0
        scale = np.append(np.abs(C).max(axis=0), size)
        scale[scale == 0] = 1.0
        a, residual = nnls(np.column_stack([C, np.full(len(E), size)]) / scale, E / size)
        if residual > EXACT * len(E):
            return (), 0.0
        return self._numbered(a[:-1] * size / scale[:-1]), a[-1] if a[-1] > EXACT else 0.0

    def _enough(self, e, sign, offset):
        """The side with factors that make e + sum_k a_k max(0, -c_k) positive, where e is so inside and not outside."""
        E, C = self._sample(e)
        inside, negative = (C >= 0).all(axis=1), E < 0
        if inside.sum() < SHOWN or negative.sum() < SHOWN or (inside & negative).any():
            return None
        outside = np.maximum(0.0, -C[negative]).sum(axis=1)
        factors = np.full(C.shape[1], 2 * (-E[negative] / outside).max())
        return Side(sign, offset, None, self._numbered(factors))

    def _numbered(self, factors):
        return tuple((k, float(a)) for (k, _), a in zip(self._conditions, factors) if a > 0)

    def _refuse_undefined(self, node, kind, argument):
        """Refuse a function that is undefined in its own region, or at the start of the solver."""
        region = ' and '.join(f'{c} >= 0' for _, c in self._conditions)
        if any(self._combination(-(s * argument + o))[0] for s, o in SIDES[kind]):
            raise FesdError(
                self._mode,
                f"its law contains '{node}', which is undefined everywhere in the region of the mode, {region}",
                "correct the sign of the argument, or exchange the regions",
            )
        if any(s * value_or_nan(argument) + o < 0 for s, o in SIDES[kind]):
            raise FesdError(
                self._mode,
                f"its law contains '{node}', which is undefined at the initial values, and the region of the mode, {region}, does "
                "not imply that it is defined",
                "state in the region what the argument needs (for sqrt(e): e >= 0), give its variables bounds, or initial values "
                "for which it is defined",
            )


def _range(v, crossing):
    """Middle and half width of the range in which a variable is sampled; ``crossing`` zero, or at one side of it."""
    if crossing:
        return start_of(v, 0.0), 2 * max(1.0, abs(start_of(v, 0.0)))
    return start_of(v), abs(start_of(v)) / 2
