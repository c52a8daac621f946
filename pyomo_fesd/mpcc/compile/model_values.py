"""Values that every solve reads from the model: bounds, fixed values and starts of variables, values of parameters.

Takes: the compiled variables and the meaning of their bounds.
Leaves: the entries of ``MpccData`` that may differ in a later solve.
"""

from dataclasses import dataclass

import numpy as np
from pyomo.core import value

from pyomo_fesd.mpcc.compile.parameters import parameter_values

#: Bounds that cross by less than this are equal.
CROSSING = 1e-8


class Contradiction(Exception):
    """Fixed values or bounds alone leave no point; the message names the component."""


@dataclass(frozen=True)
class ModelValues:
    """Reads the values of a compiled MPCC from its model.

    Attributes
    ----------
    variables : list of VarData (n)
    parameters : list of VarData and ParamData
    sides : bool array (n), variables that are sides of pairs, so never negative
    guide : array (n, 2), bounds in the homotopy of variables with guide bounds, infinite for the others
    scale : array (n)
    splits : list of (VarData, VarData, expression)
        auxiliary variables that start at the positive and the negative part of an expression
    """

    variables: list
    parameters: list
    sides: np.ndarray
    guide: np.ndarray
    scale: np.ndarray
    splits: list

    def read(self) -> dict:
        """The present values, by their names in ``MpccData``.

        Raises
        ------
        Contradiction
            for a variable whose bounds cross
        FesdError
            for a parameter without a value
        """
        for plus, minus, expr in self.splits:
            set_parts(plus, minus, expr)
        start, missing = start_values(self.variables)
        fixed = np.array([v.fixed for v in self.variables], dtype=bool)
        lower, upper = self._bounds(start, fixed)
        return {
            'lbx': lower * self.scale,
            'ubx': upper * self.scale,
            'guide_lbx': np.minimum(upper, np.maximum(lower, self.guide[:, 0])) * self.scale,
            'guide_ubx': np.maximum(lower, np.minimum(upper, self.guide[:, 1])) * self.scale,
            'guided': np.isfinite(self.guide).any(axis=1) & ~fixed,
            'x0': np.clip(start, lower, upper) * self.scale,
            'parameters': parameter_values(self.parameters),
            'missing': missing,
        }

    def _bounds(self, start, fixed):
        """As everywhere in Pyomo, the bounds of a fixed variable do not count; the sign of a side does."""
        lower, upper = stated_bounds(self.variables)
        lower, upper = np.where(fixed, start, lower), np.where(fixed, start, upper)
        lower = np.where(self.sides, np.maximum(lower, 0.0), lower)
        crossing = np.flatnonzero(lower > upper + CROSSING)
        if crossing.size:
            j = crossing[0]
            raise Contradiction(f"variable '{self.variables[j].name}' must be at least {lower[j]:g} and at most {upper[j]:g}")
        return lower, np.maximum(lower, upper)


def stated_bounds(variables):
    """The variables' bounds, infinite where there is none."""
    lower = np.array([-np.inf if v.lb is None else v.lb for v in variables], dtype=float)
    return lower, np.array([np.inf if v.ub is None else v.ub for v in variables], dtype=float)


def start_values(variables):
    """The variables' values, 0 where one is missing (or not a finite number), and the number of missing values."""
    start = _numbers([v.value for v in variables])
    known = np.isfinite(start)
    return np.where(known, start, 0.0), int(np.count_nonzero(~known))


def _numbers(values):
    """An array with nan for what is no number; one by one only where numpy cannot read them at once."""
    try:
        found = np.array(values, dtype=float)
    except (TypeError, ValueError):
        found = np.empty(0)
    return found if found.shape == (len(values),) else np.array([start_value(v) for v in values], dtype=float)


def start_value(now):
    """A variable's value as a float; None for a missing one, NaN, infinity, and what is no single number."""
    try:
        number = float(now) if np.ndim(now) == 0 else float(np.asarray(now).item())
    except (TypeError, ValueError):
        return None
    return number if np.isfinite(number) else None


def set_parts(plus, minus, expr):
    """Let two variables start at the positive and the negative part of ``expr``."""
    now = value(expr, exception=False) or 0.0
    plus.set_value(max(now, 0.0), skip_validation=True)
    minus.set_value(max(-now, 0.0), skip_validation=True)
