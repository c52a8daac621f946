"""Restoration, the feasibility phase: the least sum of violations of all rows and sides that Ipopt finds near a point.

    min  1' (p + n)   s.t.  lb <= g(w) + p - n <= ub,  G_i(w) + p_i >= 0, H_i(w) + p_i >= 0,  G_i H_i - p_i <= eps,   p, n >= 0

A stationary point with a positive sum means 'locally infeasible'; the rows and pairs with positive parts contradict each other.

Takes: a compiled MPCC and its sorted sides.
Leaves: an NLP built when it is first needed.
"""

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.compile import Outer, composed, take, with_parts


class Restoration:
    """The restoration NLP of one MPCC; parameters as ``Branch``."""

    def __init__(self, c, sides, make):
        self._c, q, chosen = c, c.pairs, sides.chosen
        eps, z = ca.SX.sym('eps'), ca.SX.sym('z', c.inner)
        G, H = take(z, range(q)), take(z, range(q, 2 * q))
        nlp = composed(c, Outer(z, ca.SX(0, 1), eps, ca.SX(0), ca.vertcat(take(z, chosen), G * H - eps)))
        self._rows = ca.Function('rows', [nlp.x, nlp.p], [nlp.g])
        self._lbg = np.concatenate([c.lbg, np.zeros(len(chosen)), np.full(q, -np.inf)])
        self._ubg = np.concatenate([c.ubg, np.full(len(chosen), np.inf), np.zeros(q)])
        self._up, self._down = np.flatnonzero(np.isfinite(self._lbg)), np.flatnonzero(np.isfinite(self._ubg))
        self._parts = len(self._up) + len(self._down)
        relaxed = with_parts(nlp, self._up, self._down)
        # the factor that the model's objective has is none for violations
        unscaled = {'obj_scaling_factor': 1.0}
        self._nlp = make('restoration', relaxed.x, relaxed.p, relaxed.f, relaxed.g, unscaled, relaxed.derivatives)

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
