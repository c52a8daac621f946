"""Reg(eps): the complementarity relaxed to G_i H_i <= eps, G, H >= 0 (Scholtes; theory, eq. 15).

Takes: a compiled MPCC.
Leaves: an NLP whose only change with eps is the upper bound of the product rows; decided pairs are left to the penalty term.
"""

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.nlp import Nlp


class Relaxation:
    """Reg(eps) of one MPCC, built once.

    Parameters
    ----------
    compiled : Compiled
    sides : Sides
        which sides need a row of their own to stay non-negative
    """

    def __init__(self, compiled, sides, options, deadline):
        c = compiled
        self._c = c
        g = ca.vertcat(c.g, sides.rows, c.G * c.H)
        self._nlp = Nlp('relaxation', c.x, ca.SX(0, 1), c.f + c.penalty, g, options, deadline)
        free = np.full(sides.rows.numel(), np.inf)
        self._lbg = np.concatenate([c.lbg, np.zeros(sides.rows.numel()), np.full(c.G.numel(), -np.inf)])
        self._ubg = np.concatenate([c.ubg, free, np.zeros(c.G.numel())])

    def solve(self, w, eps):
        """Solve Reg(eps) from ``w``."""
        q = self._c.G.numel()
        self._ubg[len(self._ubg) - q :] = eps
        return self._nlp.solve(w, [], self._c.lbx, self._c.ubx, self._lbg, self._ubg)
