"""The binaries of an LPEC (eq. 17): one for each bi-active pair.

Takes: a linearised LPEC, whose last rows are the sides G, then H, of these pairs, and the values of these at the point.
Leaves: a ``Program`` whose last variables are the binaries.
"""

import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.compile import major_index
from pyomo_fesd.mpcc.subproblems.linear_program import Program


def with_binaries(p, G, H) -> Program:
    """Return the program with  G + grad G d - M y <= 0  and  H + grad H d + M y <= M  for each pair."""
    y, A, high = len(G), p.A, p.high
    if y:
        J_G, J_H = A[-2 * y : -y], A[-y:]
        M_G, M_H = _big_m(J_G, G, p.lower, p.upper), _big_m(J_H, H, p.lower, p.upper)
        A = _stacked(A, J_G, J_H, M_G, M_H)
        high = np.concatenate([high, -G, M_H - H])
    return Program(
        np.concatenate([p.cost, np.zeros(y)]),
        A,
        np.concatenate([p.low, np.full(2 * y, -np.inf)]),
        high,
        np.concatenate([p.lower, np.zeros(y)]),
        np.concatenate([p.upper, np.ones(y)]),
        np.concatenate([p.reach, np.ones(y)]),
        y,
    )


def _big_m(J, side, d_low, d_high):
    """The largest value that each side can take in the box."""
    most = np.maximum(J.data, 0.0) * d_high[J.indices] + np.minimum(J.data, 0.0) * d_low[J.indices]
    return side + np.bincount(major_index(J), most, J.shape[0])


def _stacked(A, J_G, J_H, M_G, M_H):
    """The rows A d,  J_G d - M_G y  and  J_H d + M_H y  of columns (d, y), all csr."""
    (m, n), y = A.shape, len(M_G)
    k = np.arange(y)
    rows = [major_index(A), m + major_index(J_G), m + y + major_index(J_H), m + k, m + y + k]
    columns, numbers = [A.indices, J_G.indices, J_H.indices, n + k, n + k], [A.data, J_G.data, J_H.data, -M_G, M_H]
    places = np.concatenate(rows), np.concatenate(columns)
    return sparse.csc_matrix((np.concatenate(numbers), places), shape=(m + 2 * y, n + y))
