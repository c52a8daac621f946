"""Reg(eps): the complementarity relaxed, in forms that differ in their rows or in one term (theory, eq. 15).

Takes: a compiled MPCC and its sorted sides.
Leaves: an NLP built once, in which only the parameter eps changes.  eps means the same in every form with rows: the largest
product that two equal sides can have, so a form in t (Lin-Fukushima, Kanzow-Schwartz, ...) has t = sqrt(eps).  Decided pairs
(eq. 13) are left to the penalty.
"""

from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.compile import Outer, composed, take
from pyomo_fesd.mpcc.subproblems.single_rows import fix_single


@dataclass
class Terms:
    """Terms that a form adds: ``rows`` <= 0 (== 0 if ``equal``), ``cost`` to the objective, and perhaps one slack for all pairs."""

    rows: object = field(default_factory=lambda: ca.SX(0, 1))
    equal: bool = False
    cost: object = 0
    slack: object = None


def scholtes(G, H, eps):
    """G H <= eps.  Source: Scholtes, SIAM J. Optim. 11 (2001) 918."""
    return Terms(G * H - eps)


def scholtes_equality(G, H, eps):
    """G H = eps: the central path of the pairs, without an interior.  Source: Facchinei, Jiang, Qi, Math. Program. 85 (1999)."""
    return Terms(G * H - eps, equal=True)


def lin_fukushima(G, H, eps):
    """G H <= t^2 and (G + t)(H + t) >= t^2, t^2 = eps.  Source: Lin, Fukushima, Ann. Oper. Res. 133 (2005) 63."""
    t = ca.sqrt(eps)
    return Terms(ca.vertcat(G * H - eps, eps - (G + t) * (H + t)))


def kanzow_schwartz(G, H, eps):
    """phi(G - t, H - t) <= 0, phi(a, b) = a b if a + b >= 0, else -(a^2 + b^2)/2: an L with its corner at (t, t).

    Source: Kanzow, Schwartz, SIAM J. Optim. 23 (2013) 770.
    """
    a, b = G - ca.sqrt(eps), H - ca.sqrt(eps)
    return Terms(ca.if_else(a + b >= 0, a * b, -(a**2 + b**2) / 2))


def steffensen_ulbrich(G, H, eps):
    """G + H <= phi(G - H), phi(z) = |z| for |z| >= t, rounded within: relaxed near the corner only, exact elsewhere.

    phi(z) = t theta(z/t), theta(r) = 1 + (2/pi) sin(pi (r + 3)/2).  Source: Steffensen, Ulbrich, SIAM J. Optim. 20 (2010) 2504.
    """
    t = 2 * ca.sqrt(eps) / (1 - 2 / np.pi)
    z = G - H
    rounded = t * (1 + (2 / np.pi) * ca.sin(np.pi * (z / t + 3) / 2))
    return Terms(G + H - ca.if_else(ca.fabs(z) >= t, ca.fabs(z), rounded))


def fischer_burmeister(G, H, eps):
    """G + H = sqrt(G^2 + H^2 + 2 eps), that is G H = eps with G + H > 0.  Source: Kanzow, SIAM J. Matrix Anal. 17 (1996) 851."""
    return Terms(G + H - ca.sqrt(G**2 + H**2 + 2 * eps), equal=True)


def l1(G, H, eps):
    """min f + sum_i G_i H_i / eps (l1 elastic mode).  Source: Ralph, Wright, Optim. Methods Softw. 19 (2004) 527."""
    return Terms(cost=ca.dot(G, H) / eps)


def elastic(G, H, eps):
    """min f + s/eps, G_i H_i <= s, s >= 0: one slack for all pairs (l-infinity elastic mode).

    Source: Anitescu, SIAM J. Optim. 15 (2005) 1203.
    """
    s = ca.SX.sym('s')
    return Terms(G * H - s, cost=s / eps, slack=s)


#: A relaxation only leads to a branch, so its stationarity may be coarse; but its pairs must be accurate to eps.
LEADING = {'constr_viol_tol': 1e-8}
#: A relaxation without a minimum is given up where a variable is this many times as large as any at the start, and as 1.
DIVERGES = 1e12
#: The slack starts at 1, or just above the largest product at the start if that is less.
ROOM = 1e-2


class Relaxation:
    """The NLP of one form for one MPCC; parameters as ``Branch``."""

    def __init__(self, c, sides, form, make):
        eps = ca.SX.sym('eps')
        q = c.pairs
        z = ca.SX.sym('z', c.inner)
        terms = form(take(z, range(q)), take(z, range(q, 2 * q)), eps)
        slack = ca.SX(0, 1) if terms.slack is None else terms.slack
        self._c, self._slack = c, slack.numel()
        signs, count = len(sides.chosen), terms.rows.numel()
        self._lbg = np.concatenate([c.lbg, np.zeros(signs), np.full(count, 0.0 if terms.equal else -np.inf)])
        self._ubg = np.concatenate([c.ubg, np.full(signs, np.inf), np.zeros(count)])
        nlp = composed(c, Outer(z, slack, eps, ca.SX(terms.cost), ca.vertcat(take(z, sides.chosen), terms.rows)))
        limit = {'diverging_iterates_tol': DIVERGES * max(1.0, float(np.abs(c.x0).max(initial=0.0)))}
        self._nlp = make(form.__name__, nlp.x, nlp.p, nlp.f, nlp.g, LEADING | limit, nlp.derivatives)

    def solve(self, w, eps, duals=None, max_iter=None, fall=None):
        """Solve from ``w``, with the multipliers of an earlier result of this form if given; limits as ``NlpSolver.solve``."""
        c = self._c
        lbx, ubx, lbg, ubg = c.lbx.copy(), c.guide_ubx.copy(), self._lbg.copy(), self._ubg.copy()
        # such are distances that are zero; with shares that are one fixed too, a path of nosbench ended in a worse minimum
        fix_single(c, w, lbx, ubx, lbg, ubg, least_only=True)
        if self._slack:
            at = c.evaluate(w)
            w = np.append(w, min(1.0, (at.G * at.H).max(initial=0.0) + ROOM))
            lbx, ubx = np.append(lbx, 0.0), np.append(ubx, np.inf)
        result = self._nlp.solve(w, [eps, *c.parameters], lbx, ubx, lbg, ubg, duals, max_iter, fall=fall)
        return result.shortened(len(c.x0))


class Penalty(Relaxation):
    """min f + rho sum_i G_i H_i with a weight that grows only as long as a product is above eps (paper, eq. 16).

    Source: Leyffer, Lopez-Calva, Nocedal, SIAM J. Optim. 17 (2006) 52.
    """

    #: rho at the start and its growth.
    START, GROWTH, LIMIT = 1.0, 10.0, 1e12

    def __init__(self, c, sides, form, make):
        super().__init__(c, sides, form, make)
        self._rho = self.START

    def solve(self, w, eps, duals=None, max_iter=None, fall=None):
        """Solve from ``w`` with the weight that brings every product to ``eps``; without multipliers a new path begins."""
        if duals is None:
            self._rho = self.START
        spent = 0
        while True:
            result = super().solve(w, 1 / self._rho, duals, max_iter, fall)
            spent += result.iterations
            at = self._c.evaluate(result.w)
            if not result.solved or (at.G * at.H).max(initial=0.0) <= eps or self._rho >= self.LIMIT:
                return replace(result, iterations=spent)
            self._rho *= self.GROWTH
            w, duals = result.w, result


#: option ``relaxation`` -> class and form
FORMS = (scholtes, scholtes_equality, lin_fukushima, kanzow_schwartz, steffensen_ulbrich, fischer_burmeister, l1, elastic)
RELAXATIONS = {form.__name__: (Relaxation, form) for form in FORMS} | {'penalty': (Penalty, l1)}
