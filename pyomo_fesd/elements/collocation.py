"""pyomo.dae's collocation, with points and coefficients to machine precision.

pyomo.dae finds the points as roots of a polynomial by its coefficients, and expands Lagrange's polynomials into powers.  That
costs a digit or more for each point beyond 4: coefficients of Gauss with 10 points are off by 8e-10, relative, and so are
solutions.  Here the points are eigenvalues (Golub and Welsch), and the coefficients come from the barycentric form:

    w_i = 1/prod_j (tau_i - tau_j),   L_i'(tau_j) = w_i/w_j / (tau_j - tau_i),   sum_i L_i'(tau_j) = 0.

Takes: what pyomo.dae's ``dae.collocation`` takes.
Leaves: the same.
Does not apply: to models that were discretised before.
"""

import numpy as np
from pyomo.dae.plugins.colloc import Collocation_Discretization_Transformation


class Collocation(Collocation_Discretization_Transformation):
    """See above."""

    def _get_radau_constants(self, currentds):
        k = np.arange(self._ncp[currentds] - 1.0)
        # recurrence of Jacobi's polynomials (1, 0)
        inner = _roots(-1 / ((2 * k + 1) * (2 * k + 3)), np.sqrt(k * (k + 1)) / (2 * k + 1))
        self._set(currentds, [0.0, *inner, 1.0])

    def _get_legendre_constants(self, currentds):
        k = np.arange(float(self._ncp[currentds]))
        tau = [0.0, *_roots(0 * k, k / np.sqrt(np.abs(4 * k**2 - 1)))]
        self._set(currentds, tau)
        shares = _weights(tau) / (1 - np.array(tau))
        self._afinal[currentds] = (shares / shares.sum()).tolist()

    def _set(self, wrt, tau):
        rates = derivatives(tau)
        self._tau[wrt], self._afinal[wrt] = [float(t) for t in tau], None
        # row i: polynomial i
        self._adot[wrt], self._adotdot[wrt] = rates.T.tolist(), (rates @ rates).T.tolist()


def _roots(diagonal, beside):
    """The eigenvalues of a symmetric tridiagonal matrix, moved from [-1, 1] to [0, 1]; ``beside[0]`` stands for nothing."""
    return (np.linalg.eigvalsh(np.diag(diagonal) + np.diag(beside[1:], -1)) + 1) / 2


def _differences(tau):
    """tau_i - tau_j, with ones on the diagonal."""
    return np.subtract.outer(tau, tau) + np.eye(len(tau))


def _weights(tau):
    return 1 / _differences(tau).prod(axis=1)


def derivatives(tau):
    """The matrix that takes values at ``tau`` to derivatives there."""
    w = _weights(tau)
    rates = w / w[:, None] / _differences(tau)
    np.fill_diagonal(rates, 0)
    np.fill_diagonal(rates, -rates.sum(axis=1))
    return rates
