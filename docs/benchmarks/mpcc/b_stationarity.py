"""Check B-stationarity of a point of an mpcc-json instance without any code of pyomo_fesd.

A point x is B-stationary when d = 0 solves the LPEC (the MPCC linearised at x):

    min  grad obj' d   s.t.  linearised rows and bounds,   |d_j| <= DELTA max(1, |x_j|)
         G' d = 0,  H + H' d >= 0     G is zero at x
         H' d = 0,  G + G' d >= 0     H is zero at x
         0 <= G' d <= M y,  0 <= H' d <= N (1 - y),  y in {0, 1}     both are zero (bi-active)

M and N are the largest values of G' d and H' d in the box.  Rows that x violates are relaxed such that d = 0 is feasible.  The
feasible set is a union of cones near 0, hence DELTA does not matter for exact points.  ``l <= B <= u perp F`` is the pair
(B - l, F), or (u - B, -F) where u is nearer, and its other bound a row.

Points of interior-point methods are not exact: G H = 1e-8 may mean G = H = 1e-4.  Therefore

 * a pair is bi-active when both sides are below max(BIACTIVE, 2 sqrt(c)), c the largest scaled product at x: were it G H = c with
   one side above this, the other would be 4 times smaller, and tells which one is zero;
 * where the LPEC finds descent, it is solved again at the nearest point (1-norm, linearised, two rounds) at which the sides that
   count as zero are zero, if there is one within REACH; otherwise an error of sqrt(c) in the gradients would refute every method
   but an exact one.  The larger value counts.

The verdict is value >= -DESCENT max(1, |obj|).  DESCENT lies in a gap of the measured values: solutions of inexact methods reach
1e-5, points that are not stationary start at 1e-4, those of an exact method are at 1e-8.
"""

from dataclasses import dataclass

import highspy
import numpy as np
from scipy import sparse

DELTA = 1.0
#: Tolerance of HiGHS, far below DESCENT.
FEASIBILITY = 1e-9
REACH = 1e-2
DESCENT = 1e-4
SECONDS = 60.0


@dataclass(frozen=True)
class Verdict:
    """Result of the check.

    Attributes
    ----------
    b_stationary : True, False, or None if HiGHS reaches its time limit
    value : float, objective of the LPEC divided by max(1, |obj|)
    binaries : int, bi-active pairs
    moved : float, largest scaled step from x to the point at which the LPEC was solved
    """

    b_stationary: object
    value: float
    binaries: int
    moved: float


def check(instance, x):
    """Verdict on the point ``x`` of an ``Instance``; see the module's docstring."""
    x = np.asarray(x, dtype=float)
    here = instance.at(x)
    zero = here.zero_sides()
    verdict = _judge(instance, here, x, x, zero)
    if not verdict.b_stationary:
        near = _snap(instance, here, x, zero)
        if near is not None:
            moved = _judge(instance, instance.at(near), near, x, zero)
            verdict = moved if moved.value > verdict.value else verdict
    return verdict


def _judge(instance, here, x, start, zero):
    """Verdict on ``x``, a projection of ``start``."""
    size = max(1.0, abs(here.obj))
    value, bound, binaries = _lpec(here, *_box(instance, x, DELTA), zero)
    stationary = True if bound >= -DESCENT * size else False if value < -DESCENT * size else None
    return Verdict(stationary, value / size, binaries, float((np.abs(x - start) / np.maximum(1.0, np.abs(start))).max(initial=0.0)))


def _box(instance, x, delta):
    """Bounds of d: the trust region within the bounds of x; d = 0 is inside."""
    reach = delta * np.maximum(1.0, np.abs(x))
    return np.minimum(np.maximum(-reach, instance.lb - x), 0.0), np.maximum(np.minimum(reach, instance.ub - x), 0.0)


def _snap(instance, here, x, zero, rounds=2):
    """The nearest point where the sides that count as zero are zero; None if they are zero already, or cannot be."""
    start = x
    for _ in range(rounds):
        sides = np.concatenate([here.G[zero[0]], here.H[zero[1]]])
        if np.abs(sides).max(initial=0.0) <= FEASIBILITY:
            break
        n, J = len(x), sparse.vstack([here.A, here.J_G[zero[0]], here.J_H[zero[1]]])
        low = np.append(np.minimum(here.low, 0.0), -sides)
        high = np.append(np.maximum(here.high, 0.0), -sides)
        d_low, d_high = _box(instance, x, REACH)
        cost = np.tile(1 / np.maximum(1.0, np.abs(x)), 2)
        step, *_ = _highs(cost, sparse.hstack([J, -J]), low, high, np.zeros(2 * n), np.append(d_high, -d_low), 0)
        if step is None:
            return None
        x = x + step[:n] - step[n:]
        here = instance.at(x)
    return None if x is start else x


def _lpec(here, d_low, d_high, zero):
    """Objective of the best d found, a lower bound on it, and the number of binaries."""
    both = np.flatnonzero(zero[0] & zero[1])
    y, J_G, J_H = len(both), here.J_G[both], here.J_H[both]
    M, N = (sparse.diags(J.maximum(0) @ d_high + J.minimum(0) @ d_low, shape=(y, y)) for J in (J_G, J_H))
    G_zero, H_zero = zero[0] & ~zero[1], zero[1] & ~zero[0]
    rows = [
        (here.A, None, np.minimum(here.low, 0.0), np.maximum(here.high, 0.0)),
        (here.J_G[G_zero], None, 0.0, 0.0),
        (here.J_H[G_zero], None, -np.maximum(here.H[G_zero], 0.0), np.inf),
        (here.J_H[H_zero], None, 0.0, 0.0),
        (here.J_G[H_zero], None, -np.maximum(here.G[H_zero], 0.0), np.inf),
        (J_G, None, 0.0, np.inf),
        (J_H, None, 0.0, np.inf),
        (J_G, -M, -np.inf, 0.0),
        (J_H, N, -np.inf, N.diagonal()),
    ]
    A = sparse.vstack([sparse.hstack([J, sparse.csr_matrix((J.shape[0], y)) if Y is None else Y]) for J, Y, _, _ in rows])
    low, high = (np.concatenate([np.broadcast_to(r[k], r[0].shape[0]) for r in rows]) for k in (2, 3))
    cost, lower, upper = np.append(here.grad, np.zeros(y)), np.append(d_low, np.zeros(y)), np.append(d_high, np.ones(y))
    d, value, bound = _highs(cost, A, low, high, lower, upper, y)
    # d = 0 is feasible
    return min(value, 0.0), min(bound, 0.0), y


def _highs(cost, A, low, high, lower, upper, binaries):
    """Point, its objective (0 without one) and a lower bound; other verdicts than optimal are checked without presolve."""
    lp, A = highspy.HighsLp(), A.tocsc()
    lp.num_row_, lp.num_col_ = A.shape
    lp.col_cost_, lp.col_lower_, lp.col_upper_, lp.row_lower_, lp.row_upper_ = cost, lower, upper, low, high
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = A.indptr, A.indices, A.data
    if binaries:
        kinds = [highspy.HighsVarType.kContinuous] * (A.shape[1] - binaries)
        lp.integrality_ = kinds + [highspy.HighsVarType.kInteger] * binaries
    for presolve in ('choose', 'off'):
        highs = highspy.Highs()
        highs.setOptionValue('output_flag', False)
        for name in ('primal_feasibility_tolerance', 'dual_feasibility_tolerance', 'mip_feasibility_tolerance'):
            highs.setOptionValue(name, FEASIBILITY)
        highs.setOptionValue('time_limit', SECONDS)
        highs.setOptionValue('presolve', presolve)
        highs.passModel(lp)
        highs.run()
        info, optimal = highs.getInfo(), highs.getModelStatus() == highspy.HighsModelStatus.kOptimal
        if optimal or highs.getModelStatus() == highspy.HighsModelStatus.kTimeLimit:
            found = np.array(highs.getSolution().col_value) if info.primal_solution_status == 2 else None
            value = 0.0 if found is None else float(cost @ found)
            return found, value, value if optimal else info.mip_dual_bound if binaries else -np.inf
    return None, 0.0, -np.inf
