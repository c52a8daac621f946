"""The certificate: B-stationary means that the LPEC with every bi-active pair as a binary has the value 0 (theory, section 4).

That is: no branch has a feasible direction of descent to first order.  The certificate needs no multipliers, so it also judges
points that have none.  A point that is only stationary for a relaxation (the origin of the toy MPEC) is refused, with the
direction.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from pyomo_fesd.mpcc.compile import largest_entries
from pyomo_fesd.mpcc.subproblems.active_set import active_sets


class Stationarity(Enum):
    """The grade of a point; the value is the sentence for the user."""

    B = "B-stationary: certified by the LPEC, no branch descends"
    FEASIBLE = "feasible, and there is no objective: nothing to descend"
    DESCENT = "not certified: the LPEC found a direction of descent"
    LIMITED = "not certified: descent is only stopped by a bound of the method (guide bounds); try another discretisation or start"
    OPEN = "not certified: changes coincide, and not every order of them could be tested; try another discretisation or start"
    RELAXED = "not certified: mode='relaxation' asks for no certificate"
    UNTRIED = "not certified: the run ended before a certificate could be tried"
    UNSOLVED = "not certified: HiGHS did not solve the LPEC"
    INFEASIBLE = "not certified: the point is not feasible"


#: As many entries of a direction are printed, the largest ones.
SHOWN = 6


@dataclass(frozen=True, repr=False)
class Certificate:
    """The grade of one point and its residuals; prints them in a few lines.

    Attributes
    ----------
    grade : Stationarity
    value : float
        of the LPEC, grad f' d for |d| <= Delta, in the units of the (minimised) objective
    lpec : LpecResult or None
    biactive : int
        pairs whose both sides are zero
    violation, complementarity : float
        largest violation of rows and bounds; largest min(G_i, H_i), negative sides counted
    violation_scaled, complementarity_scaled : float
        the same, each row divided by max(1, its gradient's largest entry)
    direction : ComponentMap or None
        d of the LPEC by variable, only of ``certify``
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
        """Whether the point is B-stationary (or feasible, without an objective)."""
        return self.grade in (Stationarity.B, Stationarity.FEASIBLE)

    @property
    def feasible(self):
        """Whether rows, bounds and pairs hold."""
        return self.grade is not Stationarity.INFEASIBLE

    def __repr__(self):
        lines = [self.grade.value]
        lines += [f"violation {self.violation:.1e}, complementarity {self.complementarity:.1e}, bi-active pairs: {self.biactive}"]
        if self.value:
            lines += [f"slope of the objective along the direction: {self.value:.3g}", *self._entries()]
        return '\n'.join(lines)

    __str__ = __repr__

    def _entries(self):
        """Lines for the largest entries of the direction."""
        moved = sorted(((v, d) for v, d in (self.direction or {}).items() if d), key=lambda entry: -abs(entry[1]))
        lines = [f"  {v.name} {d:+.3g}" for v, d in moved[:SHOWN]]
        return lines + [f"  and {len(moved) - SHOWN} others"] * (len(moved) > SHOWN)


def certify_point(c, lpec, w, tolerances, equal=None, multipliers=None, patience=None) -> Certificate:
    """Judge the point ``w`` of a compiled MPCC.

    Parameters
    ----------
    lpec : Lpec
    tolerances : Tolerances
    equal : bool array or None
        decisions in force at ``w``; None reads them from eta
    multipliers : array or None
        of the branch NLP's rows (positive at lower bounds), which may make the LPEC unnecessary
    patience : float or None
        seconds for the question whether only guide bounds stop a descent: a proof of it may take longer than all NLPs
    """
    at, gradients = c.evaluate(w), c.gradients(w)
    sets, measures = _residuals(c, at, w, tolerances, gradients)
    if not _feasible(at, measures, tolerances):
        return Certificate(Stationarity.INFEASIBLE, 0.0, None, *measures)
    if not gradients[0].any():
        # no direction descends where f is flat: no LPEC is needed
        return Certificate(Stationarity.B if c.has_objective else Stationarity.FEASIBLE, 0.0, None, *measures)
    equal = at.eta > tolerances.eta if equal is None else equal
    enough = tolerances.descent
    result = lpec.solve(w, sets, tolerances.radius, equal, beyond=True, multipliers=multipliers, enough=enough)
    without_descent = Stationarity.B
    if result.descent > enough and c.guided.any():
        within = lpec.at_most(patience).solve(w, sets, tolerances.radius, equal, enough=enough)
        if within.solved:
            result, without_descent = within, Stationarity.LIMITED
    grade = Stationarity.DESCENT if result.descent > enough else without_descent if result.solved else Stationarity.UNSOLVED
    return Certificate(grade, result.value / c.scale.f, result, *measures)


def _feasible(at, measures, tolerances):
    """Whether all residuals are small; a function without a value has none."""
    defined = all(np.isfinite(values).all() for values in (at.g, at.G, at.H))
    return bool(defined and max(measures[-2:]) <= tolerances.feasibility)


def measure(c, w, tolerances) -> Certificate:
    """The residuals of a point, as a ``Certificate`` without an LPEC."""
    _, measures = _residuals(c, c.evaluate(w), w, tolerances, c.gradients(w))
    feasible = _feasible(c.evaluate(w), measures, tolerances)
    return Certificate(Stationarity.RELAXED if feasible else Stationarity.INFEASIBLE, 0.0, None, *measures)


def _residuals(c, at, w, tolerances, gradients):
    """Active sets; and number of bi-active pairs, violation and complementarity, absolute and scaled.

    Where rows are violated by v, sides that count as zero are only known to O(sqrt(v)).
    """
    _, J_g, J_G, J_H, _ = gradients
    rows, bounds = c.violations(w, at)
    low = np.minimum(at.G, at.H)
    negative = max(bounds.max(initial=0.0), -low.min(initial=0.0))
    rows_abs, bounds_abs, sides_abs = c.absolute(rows, bounds, np.concatenate([at.G, at.H]))
    low_abs = sides_abs.reshape(2, -1).min(axis=0)
    violation = max(rows_abs.max(initial=0.0), bounds_abs.max(initial=0.0), -low_abs.min(initial=0.0))
    scaled = max(np.max(rows / _scale(J_g), initial=0.0), negative)
    complementarity = float(np.max(np.abs(low) / np.minimum(_scale(J_G), _scale(J_H)), initial=0.0))
    sets = active_sets(at.G, at.H, max(tolerances.biactive, np.sqrt(scaled)))
    return sets, (int(sets.gamma.sum()), float(violation), float(np.abs(low_abs).max(initial=0.0)), float(scaled), complementarity)


def _scale(J):
    """max(1, largest entry) of each row."""
    return np.maximum(1.0, largest_entries(J))
