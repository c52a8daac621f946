"""The certificate: B-stationary means that the LPEC with every bi-active pair as a binary has the value 0 (theory, section 4).

That is: in no branch does a feasible direction descend to first order.  It needs no multipliers, so it also judges points that
have none.  A point that is only stationary for a relaxation (the origin of the toy MPEC) is refused, with the direction.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from pyomo_fesd.mpcc.active_set import active_sets


class Stationarity(Enum):
    """What is known of the point; the value is the sentence for the user."""

    B = "B-stationary: certified by the LPEC, no branch descends"
    FEASIBLE = "feasible, and there is no objective: nothing to descend"
    DESCENT = "not certified: the LPEC found a direction of descent"
    LIMITED = "not certified: descent is only stopped by a bound of the method (an element length); try another nfe or start"
    RELAXED = "not certified: mode='relaxation' asks for no certificate"
    UNSOLVED = "not certified: HiGHS did not solve the LPEC"
    INFEASIBLE = "not certified: the point is not feasible"


@dataclass(frozen=True)
class Certificate:
    """The verdict on one point.

    Attributes
    ----------
    grade : Stationarity
    value : float
        of the LPEC, grad f' d for |d| <= Delta
    lpec : LpecResult or None
    biactive : int
        pairs whose both sides are zero
    violation, complementarity : float
        largest violation of rows and bounds; largest min(G_i, H_i), negative sides counted
    violation_scaled, complementarity_scaled : float
        the same, each row divided by max(1, its gradient's largest entry)
    direction : ComponentMap or None
        d of the LPEC by variable, where a model asks for it
    """

    grade: Stationarity
    value: float
    lpec: object
    biactive: int
    violation: float
    complementarity: float
    violation_scaled: float
    complementarity_scaled: float
    direction: object = None

    @property
    def certified(self):
        """Whether the point is B-stationary (or feasible, where there is nothing to minimise)."""
        return self.grade in (Stationarity.B, Stationarity.FEASIBLE)

    @property
    def feasible(self):
        """Whether rows, bounds and pairs hold."""
        return self.grade is not Stationarity.INFEASIBLE


def certify(c, lpec, w, tolerances, equal=None, multipliers=None):
    """Judge the point ``w`` of a compiled MPCC.

    Parameters
    ----------
    lpec : Lpec
    tolerances : Tolerances
    equal : bool array or None
        decisions in force at ``w``; None reads them from eta
    multipliers : array or None
        of the branch NLP's rows (positive at lower bounds), which may spare the LPEC

    Returns
    -------
    Certificate
    """
    at = c.evaluate(w)
    grad, J_g, J_G, J_H, _ = c.gradients(w)
    sets, measures = _judged(c, at, w, tolerances, (J_g, J_G, J_H))
    if max(measures[-2:]) > tolerances.feasibility:
        return Certificate(Stationarity.INFEASIBLE, 0.0, None, *measures)
    if not grad.any():
        # nothing descends where f is flat: no LPEC is needed
        return Certificate(Stationarity.B if c.has_objective else Stationarity.FEASIBLE, 0.0, None, *measures)
    if equal is None:
        equal = at.eta > tolerances.eta
    small = tolerances.descent * max(1.0, abs(at.f))
    result = lpec.solve(w, sets, tolerances.radius, equal, beyond=True, multipliers=multipliers, small=small)
    grade = Stationarity.B
    if result.solved and result.value < -small and c.artificial.any():
        result, grade = lpec.solve(w, sets, tolerances.radius, equal, small=small), Stationarity.LIMITED
    if not result.solved:
        grade = Stationarity.UNSOLVED
    elif result.value < -small:
        grade = Stationarity.DESCENT
    return Certificate(grade, result.value, result, *measures)


def measure(c, w, tolerances):
    """The residuals of a point that is not judged, as a ``Certificate`` without an LPEC."""
    at, (_, J_g, J_G, J_H, _) = c.evaluate(w), c.gradients(w)
    _, measures = _judged(c, at, w, tolerances, (J_g, J_G, J_H))
    feasible = max(measures[-2:]) <= tolerances.feasibility
    return Certificate(Stationarity.RELAXED if feasible else Stationarity.INFEASIBLE, 0.0, None, *measures)


def _judged(c, at, w, tolerances, jacobians):
    """Active sets; and bi-active pairs, violation and complementarity, absolute and scaled.

    Where rows are violated by v, sides that count as zero are only known to O(sqrt(v)).
    """
    J_g, J_G, J_H = jacobians
    rows, bounds = c.violations(w, at)
    low = np.minimum(at.G, at.H)
    negative = max(bounds.max(initial=0.0), -low.min(initial=0.0))
    rows_abs, bounds_abs, sides_abs = c.absolute(rows, bounds, np.concatenate([at.G, at.H]))
    low_abs = sides_abs.reshape(2, -1).min(axis=0)
    violation = max(rows_abs.max(initial=0.0), bounds_abs.max(initial=0.0), -low_abs.min(initial=0.0))
    scaled = max(np.max(rows / _scale(J_g), initial=0.0), negative)
    gap = float(np.max(np.abs(low) / np.minimum(_scale(J_G), _scale(J_H)), initial=0.0))
    sets = active_sets(at.G, at.H, max(tolerances.biactive, np.sqrt(scaled)))
    return sets, (int(sets.gamma.sum()), float(violation), float(np.abs(low_abs).max(initial=0.0)), float(scaled), gap)


def _scale(J):
    """max(1, largest entry) of each row."""
    if 0 in J.shape:
        return np.ones(J.shape[0])
    return np.maximum(1.0, np.abs(J).max(axis=1).toarray().ravel())
