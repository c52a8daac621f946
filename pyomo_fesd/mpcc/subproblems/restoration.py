"""Restoration, the feasibility phase: the least sum of violations of all rows and sides that Ipopt finds near a point.

    min  1' (p + n)   s.t.  lb <= g(w) + p - n <= ub,  G_i(w) + p_i >= 0, H_i(w) + p_i >= 0,  G_i H_i - p_i <= eps,   p, n >= 0

A stationary point with a positive sum means 'locally infeasible'; the rows and pairs with positive parts contradict each other.

Takes: a compiled MPCC and its sorted sides.
Leaves: an NLP built when it is first needed.
"""

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.compile import take


class Restoration:
    """The restoration NLP of one MPCC; parameters as ``Branch``."""

    def __init__(self, c, sides, make):
        self._c = c
        eps = ca.SX.sym('eps')
        S = ca.vertcat(c.G, c.H)
        rows = ca.vertcat(c.g, take(S, sides.chosen), c.G * c.H - eps)
        self._rows = ca.Function('rows', [c.x, ca.vertcat(eps, c.p)], [rows])
        lbg = np.concatenate([c.lbg, np.zeros(len(sides.chosen)), np.full(c.G.numel(), -np.inf)])
        ubg = np.concatenate([c.ubg, np.full(len(sides.chosen), np.inf), np.zeros(c.G.numel())])
        up, down = np.flatnonzero(np.isfinite(lbg)), np.flatnonzero(np.isfinite(ubg))
        p, n = ca.SX.sym('p', len(up)), ca.SX.sym('n', len(down))
        rows[up.tolist()] += p
        rows[down.tolist()] -= n
        self._lbg, self._ubg, self._parts = lbg, ubg, len(up) + len(down)
        self._up, self._down = up, down
        self._nlp = make('restoration', ca.vertcat(c.x, p, n), ca.vertcat(eps, c.p), ca.sum1(p) + ca.sum1(n), rows)

    def solve(self, w, eps):
        """Solve from ``w``; ``f`` of the result is the remaining sum of violations."""
        c = self._c
        parameters = np.append(eps, c.parameters)
        g = np.asarray(self._rows(w, parameters), dtype=float).ravel()
        short, over = np.maximum(self._lbg - g, 0.0)[self._up], np.maximum(g - self._ubg, 0.0)[self._down]
        start = np.concatenate([w, short, over])
        lbx = np.concatenate([c.lbx, np.zeros(self._parts)])
        ubx = np.concatenate([c.guide_ubx, np.full(self._parts, np.inf)])
        result = self._nlp.solve(start, parameters, lbx, ubx, self._lbg, self._ubg)
        return result.shortened(len(w))
