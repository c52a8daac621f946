"""A start that is a solution already: without an objective every feasible, exactly complementary point is one.

Decided pairs (eq. 13) count as far as a branch can satisfy them from there: the branch that the start names is solved with their
constraints in force, and without the penalty, which would lead away from the start.  Where it has no solution, the start is one
without them.
"""

import numpy as np

from pyomo_fesd.mpcc.algorithm.state import Point
from pyomo_fesd.mpcc.nlp import NlpResult
from pyomo_fesd.mpcc.subproblems import active_sets

#: Violations below this, or below so many round-off errors of a row's terms, need no NLP to be reduced.
EXACT, ROUND_OFF = 1e-9, 16 * np.finfo(float).eps


def feasible_start(c, subsolves, w) -> tuple[Point | None, str]:
    """The start ``w``, or the solution of its branch, as a Point, or None and the reason.

    Rows whose variables the branch fixes, such as those of the first time, may be violated by ``feasibility_tol``: nothing else can
    reduce them.

    Parameters
    ----------
    c : MpccFunctions
        without an objective
    subsolves : Subsolves
    """
    if not c.eta.numel() and not c.penalty.is_constant():
        return None, "only the penalty chooses among the solutions"
    found = subsolves.measure(w)
    if not found.feasible:
        return None, f"not feasible: {_most_violated(c, w)}"
    at, tolerances = c.evaluate(w), subsolves.tolerances
    equal, exact = at.eta > tolerances.eta, is_exact(c, w)
    nlp = unchanged = NlpResult(w, at.f, 'start', 0, np.zeros(len(c.lbg)), np.zeros(len(w)))
    if not exact or np.any(np.abs(c.decided(w))[equal] > EXACT):
        zero = active_sets(at.G, at.H, tolerances.biactive).zero
        nlp = subsolves.branch(w, zero, equal, 0.0, settled=tolerances.feasibility)
    if nlp is None and (exact or _is_complementary(c, w, at, c.gradients(w))):
        # the decisions only choose among solutions, and none of these satisfies them; or Ipopt does not reach its own tolerance
        # in rows of large terms, and the start is as feasible as any answer has to be
        nlp, equal = unchanged, np.zeros_like(equal)
    if nlp is None:
        return None, f"its branch has no solution: {_most_violated(c, w, equal)}"
    certificate = subsolves.certify(nlp, equal)
    return (Point(nlp, at.f, certificate, equal), '') if certificate.certified else (None, certificate.grade.value)


def is_exact(c, w) -> bool:
    """Return whether rows, bounds and pairs hold at ``w`` as far as round-off lets them."""
    at, gradients = c.evaluate(w), c.gradients(w)
    rows, bounds = c.violations(w, at)
    held = bounds.max(initial=0.0) <= EXACT and np.all(rows <= _reachable(gradients[1], w))
    return bool(held) and _is_complementary(c, w, at, gradients)


def _is_complementary(c, w, at, gradients):
    """Whether one side of each pair is zero as far as round-off lets it, and none negative."""
    reachable = np.minimum(_reachable(gradients[2], w), _reachable(gradients[3], w))
    return bool(np.all(np.abs(np.minimum(at.G, at.H)) <= reachable))


def _reachable(J, w):
    """The residual of each row that needs no reduction: relative to its largest slope, or round-off of its terms J_ij w_j."""
    if 0 in J.shape:
        return np.full(J.shape[0], EXACT)
    slopes = np.abs(J)
    return np.maximum(EXACT * np.maximum(1.0, slopes.max(axis=1).toarray().ravel()), ROUND_OFF * (slopes @ np.abs(w)))


def _most_violated(c, w, equal=False):
    """The name of the row, bound or pair that ``w`` violates most, also among the decisions ``equal``, and by how much."""
    at = c.evaluate(w)
    rows, bounds = c.violations(w, at)
    pairs, decided = np.abs(np.minimum(at.G, at.H)), np.abs(c.decided(w)) * equal
    amounts = np.concatenate([rows, bounds, pairs, decided])
    if not amounts.size:
        return "it has no rows"
    k = int(np.argmax(np.where(np.isnan(amounts), np.inf, amounts)))
    components = [*c.constraints, *c.variables, *c.conditions, *(d.constraint for d in c.decisions)]
    # copies in other processes are without components
    name = components[k].name if components else f"row {k}"
    return f"'{name}' is violated by {amounts[k]:.1e}"
