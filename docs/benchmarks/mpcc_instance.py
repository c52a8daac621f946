"""An mpcc-json instance as casadi functions, linearised at a point; nothing of pyomo_fesd is used.

Takes: the dict that the instance's reader loads (its format stands in the README beside the instances).
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse

#: Sides below this are zero at an exact point.
BIACTIVE = 1e-6


class Instance:
    """Functions of an mpcc-json instance (a dict as its reader loads it), with sides chosen at each point."""

    def __init__(self, d):
        self._d, x = d, ca.SX.sym('x', d['n'])
        row = _rows(d, x)
        con = [row(r[2:]) for r in d['con']]
        first = [row(c[-2]) for c in d['comp']]
        second = [row(c[-1]) for c in d['comp']]
        obj = row(d['obj']) * (1 if d['sense'] == 'min' else -1)
        groups = [ca.vertcat(*g) if g else ca.SX(0, 1) for g in (con, first, second)]
        self._values = ca.Function('values', [x], [obj, *groups])
        self._slopes = ca.Function('slopes', [x], [ca.gradient(obj, x), *(ca.jacobian(g, x) for g in groups)])
        self.lb, self.ub = np.array(d['lb'], dtype=float), np.array(d['ub'], dtype=float)
        self._low = np.array([-np.inf if r[0] is None else r[0] for r in d['con']], dtype=float)
        self._high = np.array([np.inf if r[1] is None else r[1] for r in d['con']], dtype=float)
        mixed = [c[1:3] if c[0] == 'mcp' else (0.0, None) for c in d['comp']]
        self._l = np.array([-np.inf if m[0] is None else m[0] for m in mixed], dtype=float)
        self._u = np.array([np.inf if m[1] is None else m[1] for m in mixed], dtype=float)

    def at(self, x):
        """The instance linearised at ``x``."""
        obj, con, B, F = (np.asarray(v, dtype=float).ravel() for v in self._values(x))
        grad, *slopes = self._slopes(x)
        J_con, J_B, J_F = (_csr(J) for J in slopes)
        upper = np.isfinite(self._u) & ~(B - self._l < self._u - B)
        # neither bound: F = 0, the other side is never zero
        sign, near = np.where(upper, -1.0, 1.0), np.where(upper, self._u, self._l)
        G = np.where(np.isfinite(near), sign * (B - np.where(np.isfinite(near), near, 0.0)), np.inf)
        # a condition with l = u leaves F free
        H = np.where(self._l == self._u, np.inf, sign * F)
        rows = sparse.vstack([J_con, J_B]).tocsr()
        low, high = np.append(self._low - con, self._l - B), np.append(self._high - con, self._u - B)
        flip = sparse.diags(sign, shape=(len(sign), len(sign)))
        return Linear(float(obj[0]), np.asarray(grad, dtype=float).ravel(), rows, low, high, G, H, flip @ J_B, flip @ J_F)


@dataclass(frozen=True)
class Linear:
    """Objective (to be minimised), its gradient, rows ``low <= A d <= high``, values and Jacobians of the sides at one point."""

    obj: float
    grad: np.ndarray
    A: sparse.csr_matrix
    low: np.ndarray
    high: np.ndarray
    G: np.ndarray
    H: np.ndarray
    J_G: sparse.csr_matrix
    J_H: sparse.csr_matrix

    def zero_sides(self):
        """Which sides count as zero, G and H: two masks; both, for a bi-active pair (see mpcc_check)."""
        G, H = np.maximum(self.G, 0.0), np.maximum(self.H, 0.0)
        small, large = np.minimum(G, H), np.maximum(G, H)
        c = (small * np.minimum(large, 1.0)).max(initial=0.0)
        both = large <= max(BIACTIVE, 2 * np.sqrt(c))
        return both | (G <= H), both | (H < G)


def _rows(d, x):
    """A function from rows to SX, by the nodes of the instance."""
    nodes = []

    def ref(r):
        return x[r] if r >= 0 else nodes[-r - 1]

    def row(r):
        return r[0] + sum((k * ref(i) for i, k in zip(r[1], r[2])), ca.SX(0))

    for kind, *args in d['nodes']:
        if kind == 'a':
            nodes.append(row(args))
        elif kind == 'p':
            nodes.append(ref(args[0]) ** args[1])
        elif kind == 'f':
            nodes.append(getattr(ca, {'abs': 'fabs'}.get(args[0], args[0]))(ref(args[1])))
        else:
            a, b = map(ref, args)
            nodes.append({'*': a * b, '/': a / b, '^': a**b}[kind])
    return row


def _csr(J):
    """casadi DM to scipy csr."""
    shape, (colptr, row) = J.shape, (np.array(J.sparsity().colind()), np.array(J.sparsity().row()))
    return sparse.csc_matrix((np.array(J.nonzeros(), dtype=float), row, colptr), shape=shape).tocsr()
