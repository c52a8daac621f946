"""First and second derivatives of a compiled MPCC at its present point, by variables and by parameters.

Rows are z = (g, G, H, equations of decisions, w): the last n of them are the variables themselves, whose bounds are constraints
too.
"""

from functools import cached_property

import casadi as ca
import numpy as np
from pyomo.core.expr.calculus.diff_with_pyomo import reverse_ad
from scipy import sparse


class Linearisation:
    """Derivatives of a compiled MPCC at ``w``, in its scaled variables and the model's own parameters.

    Parameters
    ----------
    c : MpccFunctions
    parameters : list of VarData and ParamData
        in the order of the compiled parameters
    w : array (n)

    Attributes
    ----------
    gradient : array (n), of f; with the penalty where no decision takes its place
    J, P : csr (rows, n) and (rows, l)
    """

    def __init__(self, c, parameters, w):
        self._c, self._parameters, self._w = c, parameters, w
        self._z = ca.vertcat(c.g, c.G, c.H, c.equal)
        self._f = c.f if c.eta.numel() else c.f + c.penalty
        both = ca.vertcat(c.x, c.p)
        first = ca.Function('first', [c.x, c.p], [ca.gradient(self._f, c.x), ca.jacobian(self._z, both)])
        gradient, J = first(w, c.parameters)
        self.gradient, J = np.asarray(gradient, dtype=float).ravel(), _csr(J)
        n = len(w)
        self.J = sparse.vstack([J[:, :n], sparse.identity(n)]).tocsr()
        self.P = sparse.vstack([J[:, n:], sparse.csr_matrix((n, len(parameters)))]).tocsr()

    @cached_property
    def size(self) -> float:
        """Size of the gradient of f in the neighbourhood: its largest entry, or that of f's Hessian; 0 for a constant f."""
        hessian, _ = self.hessian(np.zeros(self.functions))
        return float(max(np.abs(self.gradient).max(initial=0.0), np.abs(hessian.data).max(initial=0.0)))

    @property
    def functions(self) -> int:
        """Number of rows before those of the variables."""
        return self._z.numel()

    def hessian(self, multipliers):
        """Derivatives of the gradient of f + multipliers' z, by variables (n, n) and parameters (n, l)."""
        c = self._c
        lagrangian = self._f + (ca.dot(ca.DM(multipliers[: self.functions]), self._z) if self.functions else 0)
        second = ca.jacobian(ca.gradient(lagrangian, c.x), ca.vertcat(c.x, c.p))
        found = _csr(ca.Function('second', [c.x, c.p], [second])(self._w, c.parameters))
        return found[:, : len(self._w)], found[:, len(self._w) :]

    @cached_property
    def bounds(self):
        """Derivatives (n, l) of the variables' lower and upper bounds, scaled, by the parameters that they contain."""
        sides = [sparse.lil_matrix((len(self._w), len(self._parameters))) for _ in range(2)]
        for j, v in enumerate(self._c.variables):
            for side, bound in zip(sides, (v.lower, v.upper)):
                if hasattr(bound, 'is_expression_type'):
                    side[j] = self.by_parameters(bound) * self._c.scale.x[j]
        return [side.tocsr() for side in sides]

    def by_parameters(self, expr):
        """Partial derivatives (l) of a Pyomo expression by the parameters."""
        slopes = reverse_ad(expr)
        return np.array([slopes.get(p, 0.0) for p in self._parameters], dtype=float)


def _csr(J):
    colptr, row = np.array(J.sparsity().colind()), np.array(J.sparsity().row())
    return sparse.csc_matrix((np.array(J.nonzeros(), dtype=float), row, colptr), shape=J.shape).tocsr()
