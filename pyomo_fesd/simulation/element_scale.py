"""Factors of the unknowns, rows and sides of one element class: those of the user, else by sizes at the start (``mpcc.compile``).

Takes: expressions of rows and sides, and the values that the variables have now.
Leaves: factors.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc import (
    beside,
    certain_constants,
    row_factors,
    side_factors,
    start_value,
    variable_factors,
    without_small,
)
from pyomo_fesd.simulation.element_equations import ElementEquations
from pyomo_fesd.simulation.element_model import known_values


@dataclass(frozen=True)
class ElementScale:
    """Factors (arrays) of unknowns, of the distances of rows from their bounds, and of sides."""

    x: np.ndarray
    rows: np.ndarray
    sides: np.ndarray


def element_scale(pattern: ElementEquations, rows, functions, slopes, bounds, user_scaling: bool) -> ElementScale:
    """Return the factors of the ``ElementRows`` of ``pattern``.

    Parameters
    ----------
    functions : ElementFunctions
        with the expressions V of x and p
    slopes : SX
        derivatives of V by x and p
    bounds : (array, array)
        of x
    user_scaling : bool
        whether the user's factors count
    """
    variables, m = [pattern.unknown[k] for k in functions.order.tolist()], len(rows.distances)
    start = np.array([start_value(v.value) or 0.0 for v in variables])
    slopes = _Slopes(pattern, m, functions, slopes)
    s_x = slopes.factors(start, bounds, _of_unknowns(pattern, variables, user_scaling))
    here, near = (slopes.largest(w, s_x) for w in (start, beside(start)))
    s_rows = row_factors([here[:m], near[:m]], _of_rows(pattern, rows.unknown, user_scaling))
    return ElementScale(s_x, s_rows, _of_sides(here[m:], rows.written, pattern, dict(zip(map(id, variables), s_x.tolist()))))


class _Slopes:
    """Values and slopes of all rows and sides; scipy's matrices take longer to make than small ones to use."""

    def __init__(self, pattern, m, functions, slopes):
        self._m, self._count, n = m, functions.V.numel(), functions.x.numel()
        known = known_values(pattern)
        known = np.array([pattern.typical.get(v, now) for v, now in zip(pattern.known, known)], dtype=float)
        inputs = functions.x, functions.p
        self._function = ca.Function('slopes', inputs, [ca.densify(functions.V), ca.densify(slopes.nz[:])])
        i, j = (np.array(part, dtype=int) for part in slopes.sparsity().get_triplet())
        self._of_unknown, self._known = j < n, known
        self._i, self._j = i[self._of_unknown], j[self._of_unknown]
        self._row_of_known, self._factor_of_known = i[~self._of_unknown], np.abs(known[j[~self._of_unknown] - n])

    def _at(self, w):
        """Values, slopes by the unknowns, and slopes by the known values."""
        values, slopes = (found.full().ravel() for found in self._function(w, self._known))
        return values, slopes[self._of_unknown], slopes[~self._of_unknown]

    def _sums(self, rows, terms):
        return np.bincount(rows, terms, self._count)

    def largest(self, w, s_x):
        """The largest slope by unknowns with the factors ``s_x``; nan where one is."""
        found = np.zeros(self._count)
        with np.errstate(invalid='ignore'):
            np.maximum.at(found, self._i, np.abs(self._at(w)[1] / s_x[self._j]))
        return found

    def factors(self, start, bounds, given):
        """Factors of the unknowns; those ``given`` (not 1) are kept."""
        w = without_small(start)
        values, slopes, by_known = self._at(w)
        terms = slopes * w[self._j]
        found = values - self._sums(self._i, terms)
        certain = certain_constants(np.abs(found), found, self._sums(self._i, np.abs(terms)))
        of_known = self._sums(self._row_of_known, np.abs(by_known) * self._factor_of_known)
        constants = np.maximum(certain, np.nan_to_num(of_known, posinf=0.0))
        # sides are zero at solutions, and so may be what is left of them
        certain = np.concatenate([constants[: self._m], without_small(constants[self._m :])])
        return variable_factors((self._i, self._j, slopes), (certain, constants), start, bounds, given, [])


def _of_unknowns(pattern, variables, user_scaling):
    """Factors of the user, or by the sizes of variables; 1 without one."""
    if not user_scaling:
        return np.ones(len(variables))
    user = pattern.factors
    found = (user.get(v, None if v is pattern.length else pattern.size_factor(v)) for v in variables)
    return np.array([_positive(factor) for factor in found])


def _of_rows(pattern, unknown, user_scaling):
    """The scale of a row is that of its variables, if the user has given all of them a factor; else 1."""
    user = pattern.factors
    if not (user and user_scaling):
        return np.ones(len(unknown))
    given = ([user.get(v) for v in some if v is not pattern.length] for some in unknown)
    return np.array([_positive(min(some)) if some and None not in some else 1.0 for some in given])


def _positive(factor):
    return 1.0 if factor is None else abs(float(factor)) or 1.0


def _of_sides(largest, written, pattern, of_variables):
    """A side that is a plain variable has its factor, others one by their largest slope."""
    factors = side_factors(np.where(np.isfinite(largest), largest, 0.0), np.ones(len(written))).tolist()
    of_variables = dict.fromkeys(map(id, pattern.known), 1.0) | of_variables
    return np.array([of_variables.get(id(side), factor) for side, factor in zip(written, factors)])
