"""Compare quantities, the arguments of piecewise functions, by their values at a few random points."""

from functools import cached_property

import numpy as np
from pyomo.common.collections import ComponentMap

from pyomo_fesd.core import mutable_parameters, value_or_nan
from pyomo_fesd.dcs.sampling import start_of, values_kept

#: Random points at which two quantities are compared.
POINTS = 5
#: Relative agreement at which two quantities, or two levels, are the same.
SAME = 1e-9
#: Rounding error of a value, relative to the terms that it is made of.
ROUNDING = 1e-13


class Quantities:
    """Values of expressions at the same few random points around the present values of their variables."""

    def __init__(self):
        self._points = ComponentMap()
        self._values = {}

    @cached_property
    def _random(self):
        # most models have no piecewise functions, and Numpy takes long to make a generator
        return np.random.default_rng(1)

    def affine(self, q, known):
        """Return (f, d) with q = f known + d, f not 0; None if there is none."""
        values, others = self._of(q), self._of(known)
        # with different mutable Params they are the same today and may not be so tomorrow
        if values is None or others is None or _parameters(q) != _parameters(known):
            return None
        return _affine(values, others)

    def slope_of_difference(self, then, otherwise, q, level):
        """Return the number f with ``then - otherwise`` = f (q - level) everywhere; None if there is none, so that it jumps."""
        values = [self._of(e) for e in (then, otherwise, q)]
        if any(v is None for v in values) or any(map(_parameters, (then, otherwise, q))):
            return None
        difference, c = values[0] - values[1], values[2] - level
        f = float(difference @ c / (c @ c)) if c.any() else 0.0
        rounding = ROUNDING * np.abs(values[:2]).max()
        return shortened(f) if np.abs(difference - f * c).max() <= SAME * np.abs(difference).max() + rounding else None

    def _of(self, expression):
        """The values; None if the expression is undefined at some point."""
        if id(expression) not in self._values:
            # with the expression itself, so that its id is not given to another one
            self._values[id(expression)] = expression, self._evaluate(expression)
        return self._values[id(expression)][1]

    def _evaluate(self, expression):
        with values_kept([expression]) as variables:
            for v in variables:
                if v not in self._points:
                    self._points[v] = start_of(v) * self._random.uniform(0.5, 1.5, POINTS)
            values = np.empty(POINTS)
            for k in range(POINTS):
                for v in variables:
                    v.set_value(self._points[v][k], skip_validation=True)
                values[k] = value_or_nan(expression)
        return values if np.isfinite(values).all() else None


def _affine(values, others):
    """(f, d) with values = f others + d, f not 0; None if there is none."""
    variation, other = values - values.mean(), others - others.mean()
    size = np.abs(other).max()
    f = float(variation @ (other / size) / (other / size @ other)) if size > 1e-100 else 0.0
    rounding = ROUNDING * max(np.abs(values).max(), np.abs(f * others).max())
    if not f or np.abs(variation - f * other).max() > SAME * np.abs(variation).max() + rounding:
        return None
    f = shortened(f)
    d = float((values - f * others).mean())
    return f, 0.0 if abs(d) <= 10 * rounding else shortened(d)


def _parameters(expression):
    return {id(p) for p in mutable_parameters(expression)}


def shortened(number: float) -> float:
    """Return a number without the rounding errors in its last digits."""
    short = float(f'{number:.12g}')
    return short if abs(short - number) <= ROUNDING * abs(number) else number
