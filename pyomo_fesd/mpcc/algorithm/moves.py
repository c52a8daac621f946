"""Changes at a point: whether one is there, and the zero sides after some have moved.

Takes: ``ChangeIndices``, and active sets or zero sides.
Leaves: answers; nothing is solved.
"""

import numpy as np

from pyomo_fesd.mpcc.subproblems import G_ZERO


def differs(change, sets):
    """Whether a change is there; a bi-active or open pair lies on both sides of it already."""
    undecided = sets.gamma | sets.open
    clear = ~undecided[change.pairs] & ~undecided[change.partners]
    happening = (sets.zero[change.happening] != G_ZERO) & ~undecided[change.happening]
    return bool(happening.any() or np.any((sets.zero[change.pairs] != sets.zero[change.partners]) & clear))


def is_alike(change, sets):
    """Whether nothing changes for certain."""
    undecided = sets.gamma | sets.open
    return not (differs(change, sets) or undecided[change.pairs].any() or undecided[change.partners].any())


def with_moves(zero, moves):
    """The zero sides after some changes have moved."""
    found = zero.copy()
    for move in moves:
        found[move.ended] = G_ZERO
        found[move.targets] = zero[move.sources]
    return found
