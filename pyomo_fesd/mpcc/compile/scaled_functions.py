"""The functions of an MPCC in the solver's scaled variables w and parameters p, with their derivatives.

The model's variables are w / s_x and p; each function is its row's factor times the row.
"""

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.compile.casadi_matrices import between, entries, times
from pyomo_fesd.mpcc.compile.row_functions import RowFunctions

#: Operations and coefficients beyond which functions are MX: SX ones are faster, but take longer to make.
LARGE = 20000


@dataclass(frozen=True, eq=False)
class ScaledFunctions:
    """f, penalty, g (m), G (q), H (q), equal (d) with derivatives; eta (d), gauges without.

    Attributes
    ----------
    main : RowFunctions, rows of f, penalty, g, G, H and equal
    others : RowFunctions, rows of eta and of the gauges
    sizes : (m, q, d)
    x : array (n), factors of the variables
    rows, other_rows : arrays, factors of the rows of ``main`` and of ``others``
    kind : type of the symbols, ca.SX or ca.MX
    """

    main: RowFunctions
    others: RowFunctions
    sizes: tuple
    x: np.ndarray
    rows: np.ndarray
    other_rows: np.ndarray
    kind: type = field(default=ca.SX)

    def outputs(self, w, p) -> dict:
        """Return all functions by name."""
        x, (m, q, d) = self._model_values(w, p), self.sizes
        main = times(self.rows, self.main.values(x))
        others = times(self.other_rows, self.others.values(x))
        ends = np.cumsum([0, 1, 1, m, q, q, d]).tolist()
        found = {name: between(main, a, b) for name, a, b in zip(('f', 'penalty', 'g', 'G', 'H', 'equal'), ends, ends[1:])}
        return found | {'eta': between(others, 0, d), 'gauges': between(others, d, others.numel())}

    def jacobian(self, w, p):
        """Return the Jacobian of (f, penalty, g, G, H, equal) by w."""
        J = self.main.jacobian(self._model_values(w, p))
        row, column = entries(J)
        return times(self.rows[row] / self.x[column], J)

    def hessian(self, w, p, factors):
        """Return the upper triangle of the Hessian of ``factors' (f, penalty, g, G, H, equal)`` by w."""
        H = self.main.hessian(self._model_values(w, p), times(self.rows, factors))
        row, column = entries(H)
        return times(1 / (self.x[row] * self.x[column]), H)

    def parameter_terms(self, w, p) -> np.ndarray:
        """Return the sizes of the terms of the parameters in (f, penalty, g, G, H, equal)."""
        return np.abs(self.rows) * self.main.parameter_terms(self._model_values(ca.DM(w), ca.DM(p)))

    def _model_values(self, w, p):
        return ca.vertcat(times(1 / self.x, w), p)
