"""Signs of the functions of one element class: which become negative in an element, and where.

Sizes of functions grow with the values seen so far; a value is negative if it is so beside the size of its function.
"""

from functools import cached_property

import numpy as np

from pyomo_fesd.core import interpolation_weights
from pyomo_fesd.simulation.element_residuals import ElementResiduals

#: A value is negative below these parts of its size, and of the solver's scale.
RELATIVE, ABSOLUTE = 1e-10, 1e-12
#: Aggregated pairs are zero below this.
ZERO = 1e-8
#: Between points a function is negative below this part of its largest value in the element; relative times at which that is tried.
DIP, BETWEEN = 1e-6, np.linspace(0.0, 1.0, 501)[1:-1]
#: A function that is zero at the left boundary rises first if it is above this part of its largest value.
RISE = 1e-6
#: An element that would end before this part of its length ends at its beginning.
AT_ONCE = 1e-6
#: A leading coefficient of a polynomial below this part of the largest one is 0.
ROUND_OFF = 1e-13


class ElementSigns:
    """Signs and sizes of the functions of one element class, with the collocation points ``tau``."""

    def __init__(self, residuals: ElementResiduals, tau: tuple[float, ...]):
        self._f, self._tau = residuals, np.array(tau)
        self._nodes = np.array([*tau, *([] if tau[-1] == 1 else [1.0])])
        self._sizes, self._size_of_others, self._size_of_pairs = np.zeros(residuals.functions.shape[0]), 0.0, 0.0

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return the sums of both sides (rows) of every condition (columns) over the collocation points."""
        return values[: 2 * len(self._f.names), : self._tau.size].sum(axis=1).reshape(-1, 2).T

    def negative(self, w: np.ndarray, active: np.ndarray) -> tuple[np.ndarray, list[int]]:
        """Return the values of all functions at ``w``, and those that are negative at some point; active sides do not count."""
        V = self._f.evaluate(w)[0]
        values = V[self._f.functions]
        low = np.minimum(values.min(axis=1, initial=np.inf), V[self._f.ends])
        negative = low < -(RELATIVE * self._grown(values) + ABSOLUTE)
        negative[zero_sides(active)] = False
        return values, np.flatnonzero(negative).tolist()

    def dips(self, values: np.ndarray, left: np.ndarray, active: np.ndarray) -> list[int]:
        """Return the continuous functions that are negative between two points although their values at these are not.

        Active sides do not count; the left boundary is a point where the value there is known and positive.
        """
        possible = self._f.continuous & ~self._f.repeated
        possible[zero_sides(active)] = False
        known = possible & (left > RELATIVE * self._sizes)
        unknown = possible & ~np.isfinite(left)
        from_left, from_first = self._polynomials_between
        found = self._negative_between(known, np.column_stack([left, values]), from_left)
        return np.flatnonzero(found | self._negative_between(unknown, values, from_first)).tolist()

    @staticmethod
    def _negative_between(possible, values, polynomials):
        """Which of the possible functions have an interpolant that is clearly negative."""
        found, rows = possible.copy(), values[possible]
        if not rows.size:
            return found
        found[possible] = (rows @ polynomials).min(axis=1, initial=np.inf) < -DIP * np.abs(rows).max(axis=1, initial=0.0)
        return found

    @cached_property
    def _polynomials_between(self):
        """Values of the Lagrange polynomials (rows) between the points, with the left boundary and without it."""
        later = BETWEEN[BETWEEN > self._nodes[0]]
        return _values_of_polynomials(np.append(0.0, self._nodes), BETWEEN), _values_of_polynomials(self._nodes, later)

    def _grown(self, values):
        return np.maximum(self._sizes, np.abs(values).max(axis=1, initial=0.0))

    def grow(self, values: np.ndarray) -> None:
        """Let the sizes grow to ``values`` of all functions."""
        self._sizes = self._grown(values)

    def begins(self, k: int, values: np.ndarray, left: float) -> float | None:
        """Return the part of the element after which function k becomes negative; None if it begins negative.

        Its ``values`` are those at the labels of the element, ``left`` that at the left boundary (nan if unknown).
        """
        nodes, row = (self._tau, values[: self._tau.size]) if self._f.repeated[k] else (self._nodes, values)
        small = RELATIVE * max(self._sizes[k], np.abs(values).max()) + ABSOLUTE
        known, falling = np.isfinite(left), row[0] < 0
        if known:
            nodes, row = np.append(0.0, nodes), np.append(max(left, 0.0), row)
        polynomial = np.polynomial.Polynomial(np.linalg.solve(np.vander(nodes, increasing=True), row))
        at_zero = left if known else polynomial(0.0)
        if at_zero <= small and falling and not (known and _rises_first(polynomial, nodes, row)):
            return None
        return _first_fall(polynomial, nodes, row)

    def others_hold(self, w: np.ndarray) -> bool:
        """Return whether bounds, further signs and aggregated pairs hold at ``w``, where V has just been evaluated."""
        f, V = self._f, self._f.V
        others = V[f.others]
        self._size_of_others = np.maximum(self._size_of_others, np.abs(others))
        slack = RELATIVE * np.abs(w) + ABSOLUTE
        pairs = V[f.cross]
        self._size_of_pairs = np.maximum(self._size_of_pairs, np.abs(pairs))
        return bool(
            (others >= -RELATIVE * self._size_of_others - ABSOLUTE).all()
            and (w >= f.lower - slack).all()
            and (w <= f.upper + slack).all()
            and (pairs <= ZERO * (1 + self._size_of_pairs)).any(axis=0).all()
        )


def zero_sides(active: np.ndarray) -> np.ndarray:
    """Return the functions that an active set holds at zero."""
    return np.arange(active.size) * 2 + active


def _values_of_polynomials(nodes, at):
    """Values of the Lagrange polynomials (rows) at some relative times."""
    return interpolation_weights(nodes, np.vander(at, nodes.size, increasing=True).T)


def _rises_first(polynomial, nodes, row):
    """Whether a polynomial that is zero at the left boundary is clearly positive before the first point, where it is negative."""
    peaks = _real_roots(polynomial.deriv())
    return polynomial(peaks[(peaks > 0) & (peaks < nodes[1])]).max(initial=0.0) > RISE * np.abs(row).max()


def _first_fall(polynomial, nodes, row):
    """The first root at which the polynomial falls; without one, the middle before the first negative node."""
    slope = polynomial.deriv()
    falls = [x for x in _real_roots(polynomial) if AT_ONCE < x <= 1.0 and slope(x) < 0]
    if falls:
        return falls[0]
    first = int(np.argmax(row < 0))
    return 0.5 * (nodes[max(first - 1, 0)] + nodes[first])


def _real_roots(polynomial):
    # a leading coefficient of round-off has a root at 1e14, beside which the others lose their digits
    roots = polynomial.trim(ROUND_OFF * np.abs(polynomial.coef).max()).roots()
    return np.sort(roots[np.abs(roots.imag) < 1e-9].real)
