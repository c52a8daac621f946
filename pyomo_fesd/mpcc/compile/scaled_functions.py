"""The functions of an MPCC in the solver's scaled variables w and parameters p, with their derivatives.

The model's variables are w / s_x and p; each function is its row times its row's factor.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.compile.casadi_matrices import between, entries, times
from pyomo_fesd.mpcc.compile.row_functions import RowFunctions

#: Operations and coefficients beyond which functions are MX: SX ones are faster, but take longer to make.
LARGE = 2000
#: Up to so many, casadi differentiates the expressions as a whole in less time than derivatives of classes take to assemble.
SHORT = 2000


@dataclass(frozen=True, eq=False)
class ScaledRows:
    """``factors`` times ``functions`` of w / ``x`` and p."""

    functions: RowFunctions
    factors: np.ndarray
    x: np.ndarray

    def values(self, w, p):
        """Return the column of values."""
        return times(self.factors, self.functions.values(self._model_values(w, p)))

    def jacobian(self, w, p):
        """Return the Jacobian by w."""
        J = self.functions.jacobian(self._model_values(w, p))
        row, column = entries(J)
        return times(self.factors[row] / self.x[column], J)

    def hessian(self, w, p, multipliers):
        """Return the upper triangle of the Hessian of ``multipliers' values`` by w."""
        H = self.functions.hessian(self._model_values(w, p), times(self.factors, multipliers))
        row, column = entries(H)
        return times(1 / (self.x[row] * self.x[column]), H)

    def parameter_terms(self, w, p) -> np.ndarray:
        """Return the sizes of the terms of the parameters."""
        return np.abs(self.factors) * self.functions.parameter_terms(self._model_values(ca.DM(w), ca.DM(p)))

    def _model_values(self, w, p):
        x = times(1 / self.x, w)
        return ca.vertcat(x, p) if p.numel() else x


@dataclass(frozen=True, eq=False)
class ScaledFunctions:
    """All functions of an MPCC with m rows, q pairs and d decisions.

    Attributes
    ----------
    cost : ScaledRows, f and penalty
    rows : ScaledRows, g (m)
    sides : ScaledRows, G (q), H (q), equal (d)
    others : ScaledRows, eta (d), gauges
    pairs : int, q
    kind : type of the symbols, ca.SX or ca.MX
    """

    cost: ScaledRows
    rows: ScaledRows
    sides: ScaledRows
    others: ScaledRows
    pairs: int
    kind: type

    @property
    def short(self) -> bool:
        """Whether all functions are SX and short."""
        parts = (self.cost, self.rows, self.sides)
        return self.kind is ca.SX and sum(part.functions.size for part in parts) <= SHORT

    @property
    def decisions(self) -> int:
        """Number d."""
        return len(self.sides.factors) - 2 * self.pairs

    def outputs(self, w, p) -> dict:
        """Return all functions by name."""
        q, d = self.pairs, self.decisions
        cost, z, others = (rows.values(w, p) for rows in (self.cost, self.sides, self.others))
        return {
            'f': cost[0],
            'penalty': cost[1],
            'g': self.rows.values(w, p),
            'G': between(z, 0, q),
            'H': between(z, q, 2 * q),
            'equal': between(z, 2 * q, 2 * q + d),
            'eta': between(others, 0, d),
            'gauges': between(others, d, others.numel()),
        }
