"""Which side of each pair is zero (theory, eq. 16)."""

from dataclasses import dataclass

import numpy as np

#: The side of a pair that is zero in a branch; FREE leaves the pair open.
G_ZERO, H_ZERO, FREE = 0, 1, 2


@dataclass(frozen=True)
class ActiveSets:
    """I_alpha, I_beta, I_gamma at a point.

    Attributes
    ----------
    zero : int array (q)
        the smaller side of each pair, ``G_ZERO`` or ``H_ZERO``; ``FREE`` where the pair is left open
    gamma : bool array (q)
        pairs whose both sides are zero within the tolerance
    """

    zero: np.ndarray
    gamma: np.ndarray

    @property
    def alpha(self):
        """Pairs with G = 0 < H."""
        return (self.zero == G_ZERO) & ~self.gamma

    @property
    def beta(self):
        """Pairs with H = 0 < G."""
        return (self.zero == H_ZERO) & ~self.gamma

    @property
    def open(self):
        """Pairs that are left open: both sides are only not negative."""
        return self.zero == FREE

    def same_sides(self, other):
        """Whether the same side is zero in every pair."""
        return other is not None and np.array_equal(self.zero, other.zero)


def active_sets(G, H, tolerance):
    """Active sets of sides with values ``G`` and ``H``; ``tolerance`` is O(sqrt(eps)) at a solution of Reg(eps)."""
    return ActiveSets(np.where(G <= H, G_ZERO, H_ZERO), np.maximum(G, H) <= tolerance)
