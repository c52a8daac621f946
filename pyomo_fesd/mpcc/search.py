"""Depth-first search over the pairs, for problems whose feasible branches neither Reg(eps) nor the LPEC finds.

A node fixes one side of some pairs to zero and asks only for G, H >= 0 of the others. Its solution either violates no pair, and
then names a branch, or it is split on the pair that it violates most, the side that is nearer to zero first. A node for which
no feasible point is found, from its parent's solution or from the start, is not followed: where the NLPs are convex, an
exhausted search proves that there is no feasible branch.

Source: Bard, Moore, SIAM J. Sci. Stat. Comput. 11 (1990) 281.
"""

import numpy as np

from pyomo_fesd.mpcc.active_set import FREE, G_ZERO, H_ZERO

#: Nodes, and the iterations that each attempt at one may use.
NODES, ITERATIONS = 300, 100


def leaves(compiled, branch, w, tolerance):
    """Points and assignments of branches that the search finds.

    Parameters
    ----------
    compiled : Compiled
    branch : callable (w, zero, equal, weight, max_iter=...) -> NlpResult or None
    w : array
        where to start
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
            # the parent's solution can be a bad start: its sides are zero that now have to leave it
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
        for side in (1 - nearer[k], nearer[k]):
            child = zero.copy()
            child[k] = side
            stack.append((solved.w, child))
