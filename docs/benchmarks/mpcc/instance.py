"""Functions of an mpcc-json instance in casadi and their linearisation, without any code of pyomo_fesd."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse

#: Sides below this are zero at an exact point.
BIACTIVE = 1e-6


class Instance:
    """Functions of an mpcc-json instance.

    Parameters
    ----------
    d : dict
        the instance as ``mpcc_json.load`` returns it; the README beside the instances describes the format
    """

    def __init__(self, d):
        x = ca.SX.sym('x', d['n'])
        row = _rows(d, x)
        obj = row(d['obj']) * (1 if d['sense'] == 'min' else -1)
        constraints = [r[2:] for r in d['con']]
        first, second = ([c[side] for c in d['comp']] for side in (-2, -1))
        groups = [_column(map(row, rows)) for rows in (constraints, first, second)]
        self._values = ca.Function('values', [x], [obj, *groups])
        self._slopes = ca.Function('slopes', [x], [ca.gradient(obj, x), *(ca.jacobian(g, x) for g in groups)])
        self.lb, self.ub = np.array(d['lb'], dtype=float), np.array(d['ub'], dtype=float)
        self._low, self._high = _bounds([r[:2] for r in d['con']])
        self._l, self._u = _bounds([c[1:3] if c[0] == 'mcp' else (0.0, None) for c in d['comp']])

    def at(self, x):
        """Linearise at ``x``; of a condition with two bounds, the nearer one gives the sides."""
        obj, con, B, F = (np.asarray(v, dtype=float).ravel() for v in self._values(x))
        grad, *slopes = self._slopes(x)
        J_con, J_B, J_F = (_csr(J) for J in slopes)
        upper = np.isfinite(self._u) & ~(B - self._l < self._u - B)
        # without bounds F = 0, and the other side is never zero
        sign, near = np.where(upper, -1.0, 1.0), np.where(upper, self._u, self._l)
        G = np.where(np.isfinite(near), sign * (B - np.where(np.isfinite(near), near, 0.0)), np.inf)
        # with l = u, F is free
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
        """Masks of the sides G and H that count as zero; a bi-active pair is in both (see ``b_stationarity``)."""
        G, H = np.maximum(self.G, 0.0), np.maximum(self.H, 0.0)
        small, large = np.minimum(G, H), np.maximum(G, H)
        c = (small * np.minimum(large, 1.0)).max(initial=0.0)
        both = large <= max(BIACTIVE, 2 * np.sqrt(c))
        return both | (G <= H), both | (H < G)


def _column(expressions):
    """A column of casadi expressions, which may be empty."""
    return ca.vertcat(ca.SX(0, 1), *expressions)


def _bounds(pairs):
    """Arrays of lower and upper bounds; None is infinite."""
    low = np.array([-np.inf if lower is None else lower for lower, _ in pairs], dtype=float)
    return low, np.array([np.inf if upper is None else upper for _, upper in pairs], dtype=float)


def _rows(d, x):
    """A function that turns a row of the instance into casadi SX."""
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
    """A casadi DM as a scipy csr_matrix."""
    shape, (colptr, row) = J.shape, (np.array(J.sparsity().colind()), np.array(J.sparsity().row()))
    return sparse.csc_matrix((np.array(J.nonzeros(), dtype=float), row, colptr), shape=shape).tocsr()
