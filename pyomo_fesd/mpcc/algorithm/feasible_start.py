"""A start that is a solution already: without an objective every feasible, exactly complementary point is one.

Decided pairs (eq. 13) count as far as a branch can satisfy them from there: the branch that the start names is solved with their
constraints in force, and without the penalty, which would lead away from the start.
"""

import numpy as np

from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.mpcc.subproblems import active_sets

#: Violations below this need no NLP to be reduced.
EXACT = 1e-9


def feasible_start(c, subsolves, w) -> Point | None:
    """The start ``w``, or the solution of its branch, as a Point; None if it is not feasible or its branch has no solution.

    Parameters
    ----------
    c : MpccFunctions
        without an objective
    subsolves : Subsolves
    """
    if not c.eta.numel() and not c.penalty.is_constant():
        # only the penalty chooses among the solutions
        return None
    found = subsolves.measure(w)
    if not found.feasible:
        return None
    at, tolerances = c.evaluate(w), subsolves.tolerances
    equal = at.eta > tolerances.eta
    if max(found.violation_scaled, found.complementarity_scaled) <= EXACT and not np.any(np.abs(c.decided(w))[equal] > EXACT):
        nlp = NlpResult(w, at.f, 'start', 0, np.zeros(len(c.lbg)), np.zeros(len(w)))
    else:
        zero = active_sets(at.G, at.H, tolerances.biactive).zero
        nlp = subsolves.branch(w, zero, equal, 0.0)
    if nlp is None:
        return None
    certificate = subsolves.certify(nlp, equal)
    return Point(nlp, at.f, certificate, equal) if certificate.certified else None
