"""Reg(eps): the complementarity relaxed, in forms that differ in one row or term (theory, eq. 15).

Takes: a compiled MPCC and its sorted sides.
Leaves: an NLP built once, in which only a bound or a parameter changes with eps.  Decided pairs (eq. 13) are left to the penalty.
"""

from dataclasses import replace

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.nlp import Nlp


class _Relaxation:
    """What the forms share: rows and bounds of the model and the signs of the sides that bounds do not imply."""

    def __init__(self, c, sides, options, deadline):
        self._c = c
        self._lbg = np.concatenate([c.lbg, np.zeros(sides.rows.numel()), np.full(c.G.numel(), -np.inf)])
        self._ubg = np.concatenate([c.ubg, np.full(sides.rows.numel(), np.inf), np.zeros(c.G.numel())])
        self._build(c, ca.vertcat(c.g, sides.rows), options, deadline)


class Scholtes(_Relaxation):
    """min f  s.t.  G, H >= 0,  G_i H_i <= eps."""

    def _build(self, c, rows, options, deadline):
        self._nlp = Nlp('scholtes', c.x, ca.SX(0, 1), c.f + c.penalty, ca.vertcat(rows, c.G * c.H), options, deadline)

    def solve(self, w, eps):
        """Solve from ``w``; eps is the upper bound of the product rows."""
        self._ubg[len(self._ubg) - self._c.G.numel() :] = eps
        return self._nlp.solve(w, [], self._c.lbx, self._c.guide_ubx, self._lbg, self._ubg)


class Elastic(_Relaxation):
    """min f + s/eps  s.t.  G, H >= 0,  G_i H_i <= s,  s >= 0: one slack for all pairs (l-infinity elastic mode).

    On simulations with finite elements it needs far fewer iterations than ``Scholtes``.
    """

    #: First value of s: 1, or just above what the start violates once that is less.
    ROOM = 1e-2

    def _build(self, c, rows, options, deadline):
        s, weight = ca.SX.sym('s'), ca.SX.sym('weight')
        f = c.f + c.penalty + weight * s
        products = c.G * c.H
        by_x = ca.jacobian(ca.vertcat(rows, products), c.x)
        by_s = ca.vertcat(ca.SX(rows.numel(), 1), -ca.SX.ones(products.numel(), 1))
        w, g = ca.vertcat(c.x, s), ca.vertcat(rows, products - s)
        self._nlp = Nlp('elastic', w, weight, f, g, options, deadline, jacobian=ca.horzcat(by_x, by_s))

    def solve(self, w, eps):
        """Solve from ``w``; 1/eps is the weight of s."""
        c = self._c
        at = c.evaluate(w)
        s = min(1.0, (at.G * at.H).max(initial=0.0) + self.ROOM)
        lbx, ubx = np.append(c.lbx, 0.0), np.append(c.guide_ubx, np.inf)
        result = self._nlp.solve(np.append(w, s), [1 / eps], lbx, ubx, self._lbg, self._ubg)
        return replace(result, w=result.w[:-1])


#: option ``relaxation`` -> form
RELAXATIONS = {'elastic': Elastic, 'scholtes': Scholtes}
