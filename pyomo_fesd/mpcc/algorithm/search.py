"""Depth-first search over the pairs, for problems whose feasible branches neither Reg(eps) nor the LPEC finds.

A node fixes one side of some pairs to zero and only requires G, H >= 0 of the others.  A solution that violates no pair names a
branch; otherwise the node is split on the larger side of the pair that it violates most: either it is positive, and what it is
paired with is zero, or it is zero itself.  Where sides are in one pair each, these are the two sides of the pair; where they are
in several (eq. 11c), both children decide more than this pair.  A node for which no feasible point is found, from its parent's
solution or from the start, is not followed: where the NLPs are convex, an exhausted search proves that there is no feasible
branch.

Source: Bard, Moore, SIAM J. Sci. Stat. Comput. 11 (1990) 281.
"""

from enum import Enum

import numpy as np

from pyomo_fesd.mpcc.subproblems import FREE, G_ZERO, H_ZERO

#: Nodes, and the iterations that each attempt at one may use.
NODES, ITERATIONS = 300, 100
#: An exhaustive search needs few pairs, and iterations enough to show that a node is infeasible.
FEW, PATIENCE = 5, 300


def leaves(compiled, branch, w, tolerance):
    """Search for branches; yield a point and the zero sides of each one found.

    Parameters
    ----------
    compiled : MpccFunctions
    branch : callable (w, zero, equal, weight, max_iter=...) -> NlpResult or None
    w : array
        start of the search
    tolerance : float
        a pair is violated where both sides are above it

    Yields
    ------
    (array (n), int array (q))
    """
    stack = [(w, np.full(compiled.G.numel(), FREE))]
    for _ in range(NODES):
        if not stack:
            return
        start, zero = stack.pop()
        solved = branch(start, zero, None, 1.0, max_iter=ITERATIONS)
        if solved is None and start is not w:
            # at the parent's solution the wrong side of the pair may be zero
            solved = branch(w, zero, None, 1.0, max_iter=ITERATIONS)
        if solved is None:
            continue
        at = compiled.evaluate(solved.w)
        nearer = np.where(at.G <= at.H, G_ZERO, H_ZERO)
        violation = np.where(zero == FREE, np.minimum(at.G, at.H), 0.0)
        if violation.max(initial=0.0) <= tolerance:
            yield solved.w, np.where(zero == FREE, nearer, zero)
            continue
        k = int(np.argmax(violation))
        positive, itself = _children(compiled, zero, k, 1 - nearer[k])
        stack += [(solved.w, itself), (solved.w, positive)]


def _children(compiled, zero, k, larger):
    """The two decisions on side ``larger`` of pair k: it is positive, so that its partners are zero; it is zero itself."""
    sides = compiled.side_of.reshape(2, -1)
    as_G, as_H = (zero == FREE) & (sides == sides[larger, k])
    positive = np.where(as_G, H_ZERO, np.where(as_H, G_ZERO, zero))
    itself = np.where(as_G, G_ZERO, np.where(as_H, H_ZERO, zero))
    return positive, itself


class Verdict(Enum):
    """Result of an exhaustive search."""

    FOUND = 'a branch has a feasible point'
    NONE = 'no branch has one'
    OPEN = 'there are too many pairs, or the model without them was not solved'


def exhaust(compiled, node, w) -> Verdict:
    """Search all branches of few pairs from ``w``.

    The model with all pairs open has to be solved, or shown to be infeasible; a branch counts as infeasible as well where the
    NLP solver only fails.

    Parameters
    ----------
    node : callable (w, zero, max_iter) -> (NlpResult or None, bool)
        a usable solution, and whether the node is shown to be infeasible where there is none
    """
    q = compiled.G.numel()
    if q > FEW:
        return Verdict.OPEN
    root = np.full(q, FREE)
    stack = [(w, root)]
    while stack:
        start, zero = stack.pop()
        solved, infeasible = _attempt(compiled, node, (start, w), zero)
        if solved is None:
            if zero is root and not infeasible:
                return Verdict.OPEN
            continue
        if not np.any(zero == FREE):
            return Verdict.FOUND
        at = compiled.evaluate(solved.w)
        k = int(np.argmax(np.where(zero == FREE, np.minimum(at.G, at.H), -np.inf)))
        positive, itself = _children(compiled, zero, k, int(at.G[k] <= at.H[k]))
        stack += [(solved.w, positive), (solved.w, itself)]
    return Verdict.NONE


def _attempt(compiled, node, starts, zero):
    """The result of a node from the first of ``starts`` that solves it; from one only where that is a proof."""
    solved, infeasible = node(starts[0], zero, PATIENCE)
    if solved is None and starts[0] is not starts[1] and not (infeasible and compiled.linear):
        solved, infeasible = node(starts[1], zero, PATIENCE)
    return solved, infeasible
