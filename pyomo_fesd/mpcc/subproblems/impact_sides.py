"""Sides and bounds of the laws of contacts that leave a branch NLP an interior (theory, eq. 21 and 22).

Takes: ``ImpactIndices``, ``StickingIndices`` and ``DriftIndices``, an assignment and the bounds of its branch.
Leaves: the assignment in which impulses are free only where bodies meet; bounds that equations imply are left out.
"""

from collections import defaultdict

import numpy as np

from pyomo_fesd.mpcc.subproblems.active_set import G_ZERO, H_ZERO


def with_impacts(c, zero, ubx):
    """The assignment with the sides of impacts that upper bounds ``ubx`` of its branch decide."""
    new, by_boundary = zero.copy(), defaultdict(list)
    for impact in c.impacts:
        if _meets(impact, ubx):
            new[impact.pairs] = H_ZERO
        by_boundary[impact.boundary].append(impact)
    for sticking in c.stickings:
        if not np.any(ubx[sticking.meeting]) and not np.any(ubx[sticking.after]):
            new[sticking.pair] = H_ZERO
    for beside in by_boundary.values():
        if all(_touched(impact, ubx) for impact in beside if np.any(new[impact.pairs] != G_ZERO)):
            for impact in beside:
                new[impact.pairs] = G_ZERO
    return new


def give_interior(c, zero, lbx, ubx, lbg, ubg):
    """Leave out what has no interior in the branch of an assignment, in place: rows 0 >= 0, and N >= 0 where N = 0 follows."""
    for impact in c.impacts:
        if _meets(impact, ubx):
            ubx[impact.below] = 0.0
        elif _touched(impact, ubx) and np.all(zero[impact.pairs] == G_ZERO):
            ubx[impact.above], lbx[impact.below], lbg[impact.room] = 0.0, -np.inf, -np.inf
        if ubx[impact.below] == 0.0:
            lbg[impact.room] = -np.inf
    settle_drifts(c, ubx == 0.0, lbx, ubx, lbg, ubg)


def settle_drifts(c, is_zero, lower, upper, low, high):
    """Fix the drift of an open element, or the rate of a closed one, and free their weighted equation, in place (eq. 22).

    Parameters
    ----------
    is_zero : bool array (n)
        variables that are 0
    lower, upper, low, high : arrays
        bounds of variables and rows
    """
    for drift in c.drifts:
        j = gone(drift, is_zero)
        if j is not None:
            lower[j] = upper[j] = 0.0
            low[drift.row], high[drift.row] = -np.inf, np.inf


def gone(drift, is_zero):
    """What is zero of a drift and its rate, where its forces or its distances are: a variable, or None."""
    return drift.drift if np.all(is_zero[drift.forces]) else drift.rate if np.all(is_zero[drift.distances]) else None


def _touched(impact, ubx):
    """Whether the bodies touch in the element before, with a force."""
    return len(impact.before) > 0 and not np.any(ubx[impact.before]) and np.any(ubx[impact.within])


def _meets(impact, ubx):
    """Whether the bodies meet at the boundary, or N has no room at the first time."""
    return not np.any(ubx[impact.within])
