"""What every solve reads from the model's variables: bounds, fixed values, start; and the values of its parameters.

Takes: the compiled variables and what their bounds mean.
Leaves: the entries of ``Numbers`` that a later solve may find changed.
"""

from dataclasses import dataclass

import numpy as np
from pyomo.core import value

from pyomo_fesd.mpcc.parameters import parameter_values

#: Bounds that cross by less than this are equal.
CROSSING = 1e-8


class Contradiction(Exception):
    """Fixed values or bounds alone leave no point; the message names the component."""


@dataclass(frozen=True)
class Source:
    """Where the numbers of a compiled MPCC come from.

    Attributes
    ----------
    variables : list of VarData (n)
    parameters : list of VarData and ParamData
    sides : bool array (n), variables that are sides of pairs, so never negative
    guide : array (n, 2), bounds in the homotopy of variables whose bounds belong to the method, elsewhere infinite
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

    def read(self):
        """The present values, by their names in ``Numbers``.

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
        lower = np.array([-np.inf if v.lb is None else v.lb for v in self.variables], dtype=float)
        upper = np.array([np.inf if v.ub is None else v.ub for v in self.variables], dtype=float)
        # as everywhere in Pyomo, the bounds of a fixed variable do not count; the sign of a side does
        lower, upper = np.where(fixed, start, lower), np.where(fixed, start, upper)
        lower = np.where(self.sides, np.maximum(lower, 0.0), lower)
        self._refuse_crossing(lower, upper)
        upper = np.maximum(lower, upper)
        return {
            'lbx': lower * self.scale,
            'ubx': upper * self.scale,
            'guide_lbx': np.minimum(upper, np.maximum(lower, self.guide[:, 0])) * self.scale,
            'guide_ubx': np.maximum(lower, np.minimum(upper, self.guide[:, 1])) * self.scale,
            'artificial': np.isfinite(self.guide).any(axis=1) & ~fixed,
            'x0': np.clip(start, lower, upper) * self.scale,
            'parameters': parameter_values(self.parameters),
            'missing': missing,
        }

    def _refuse_crossing(self, lower, upper):
        crossing = np.flatnonzero(lower > upper + CROSSING)
        if crossing.size:
            j = crossing[0]
            raise Contradiction(f"variable '{self.variables[j].name}' must be at least {lower[j]:g} and at most {upper[j]:g}")


def start_values(variables):
    """The variables' values, 0 where there is none, and how many there are not."""
    start = np.array([np.nan if v.value is None else v.value for v in variables], dtype=float)
    known = np.isfinite(start)
    return np.where(known, start, 0.0), int(np.count_nonzero(~known))


def set_parts(plus, minus, expr):
    """Let two variables start at the positive and the negative part of ``expr``."""
    now = value(expr, exception=False) or 0.0
    plus.set_value(max(now, 0.0), skip_validation=True)
    minus.set_value(max(-now, 0.0), skip_validation=True)
