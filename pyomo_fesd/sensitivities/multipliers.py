"""Which active inequalities hold strictly: those that others imply, and those with a positive multiplier.

    gradient + A' lam = 0,      lam_i >= 0 for open rows

Non-negative values whose sum is 0 are implied to be 0: there A' lam = 0 has a solution that is positive for them.  Where rows are
redundant there are many multipliers; then a linear program finds one that is positive for as many open rows as possible.
"""

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from pyomo_fesd.sensitivities.kkt import Kkt, largest_entries

#: A multiplier counts as positive above this part of the size of gradients: Ipopt leaves one that should be zero at 1e-5.
STRICT = 1e-4
#: The gradient of the Lagrangian counts as zero below this part: Ipopt's point is not exact.
STATIONARY = 1e-5
#: The linear program may miss this part besides: a slack as large as STATIONARY would feed multipliers that are zero.
SLACK = 1e-7
#: Slack of the linear program for implied rows.
IMPLIED = 1e-9


def implied(A, is_open):
    """Mask of the open rows that the other active rows force to hold with equality.

    Parameters
    ----------
    A : csr (m, n)
        gradients of the active rows, open ones written as A w <= 0
    is_open : bool array (m)
    """
    if not is_open.any():
        return is_open
    largest = largest_entries(A)
    A = sparse.diags(1.0 / np.where(largest > 0, largest, 1.0)) @ A
    lam = _most_positive(np.zeros(A.shape[1]), A, is_open, 1.0, IMPLIED)
    return is_open & (lam > STRICT)


def multipliers(gradient, A, is_open, size):
    """Return multipliers (m) and the mask of the open rows in which they are positive; None where there are none.

    Parameters
    ----------
    gradient : array (n)
    A, is_open : as for ``implied``
    size : float
        of the gradient in the neighbourhood; 0 where there is nothing to minimise
    """
    if size == 0.0:
        return np.zeros(A.shape[0]), np.zeros(A.shape[0], dtype=bool)
    least = Kkt(sparse.identity(A.shape[1], format='csr'), A).solve(-gradient[:, None], np.zeros((A.shape[0], 1)))
    # min |x|^2 + 2 gradient' x, A x = 0: x is what no multiplier balances
    missing = np.abs(least.x).max(initial=0.0)
    if not least.exists[0] or missing > STATIONARY * size:
        return None
    lam = least.y[:, 0]
    if not np.all(lam[is_open] > STRICT * size):
        lam = _most_positive(gradient, A, is_open, 2 * STRICT * size, 2 * missing + SLACK * size)
    return None if lam is None else (lam, is_open & (lam > STRICT * size))


def _most_positive(gradient, A, is_open, enough, slack):
    """Multipliers that balance the gradient up to ``slack``; those of open rows are at least t_i, 0 <= t_i <= enough, max sum t."""
    (m, n), k = A.shape, np.count_nonzero(is_open)
    picks = sparse.csr_matrix((np.ones(k), (np.arange(k), np.flatnonzero(is_open))), shape=(k, m))
    balance = sparse.hstack([A.T, sparse.csr_matrix((n, k))])
    found = linprog(
        np.concatenate([np.zeros(m), -np.ones(k)]),
        A_ub=sparse.vstack([balance, -balance, sparse.hstack([-picks, sparse.identity(k)])]).tocsr(),
        b_ub=np.concatenate([-gradient + slack, gradient + slack, np.zeros(k)]),
        bounds=[(None, None)] * m + [(0.0, enough)] * k,
        method='highs',
        options={'primal_feasibility_tolerance': 1e-10},
    )
    return None if found.x is None else found.x[:m]
