"""Sort the sides of all pairs into those that bounds keep non-negative and those that need a row.

A linear side whose least value over the variables' bounds is 0 needs no row: the bounds keep it non-negative, and it is zero
exactly when each of its variables is at the bound that gives the least value.  So a branch fixes variables instead of adding
equations ("a sum of non-negative variables is 0"), and Ipopt gets no superfluous equations.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.compile import major_index
from pyomo_fesd.mpcc.subproblems.active_set import FREE, G_ZERO, H_ZERO
from pyomo_fesd.mpcc.subproblems.impact_sides import with_impacts

#: Agreement of a side's least value with 0.
EXACT = 1e-12
#: A constant side is zero below this.
SETTLED = 1e-9
#: An amount this near to the end of a place, relative to all places, may belong to either side of it.
TIE = 1e-7
#: A follower does not agree with its leader if the side that should be zero is above this.
OPEN = 1e-3


@dataclass
class Sides:
    """Sides G (first q) and H (last q) of a compiled MPCC, index k = side * q + pair.

    Attributes
    ----------
    chosen : int array
        sides that need a row of their own, each once
    row_of : int array (2q)
        position of a side among these rows, -1 where bounds do
    fixings : csr (2q, n)
        bound at which a side without a row is zero: 1 the variable's lower, 2 its upper
    """

    chosen: np.ndarray
    row_of: np.ndarray
    fixings: object

    def zero_rows(self, zero):
        """Mask over the sides (2q) that an assignment sets to zero."""
        return np.concatenate([zero == G_ZERO, zero == H_ZERO])

    def constant(self, fixed):
        """Mask over the sides (2q) whose variables are all among the ``fixed`` (mask over the n variables)."""
        return np.bincount(self._side[~fixed[self.fixings.indices]], minlength=self.fixings.shape[0]) == 0

    def variables(self, which):
        """The variables of the sides in a mask (2q), and the bounds at which these sides are zero: 1 lower, 2 upper."""
        inside = which[self._side]
        return self.fixings.indices[inside], self.fixings.data[inside]

    @cached_property
    def _side(self):
        """The side of each entry of ``fixings``."""
        return major_index(self.fixings)

    def bounds(self, zero, lbx, ubx):
        """Bounds of the variables (from ``lbx`` and ``ubx``) in the branch of an assignment; they may contradict each other."""
        return self.bounds_with(self.zero_rows(zero), lbx, ubx)

    def bounds_with(self, given, lbx, ubx):
        """Bounds of the variables with the sides in a mask (2q) at zero."""
        fixed, bound = self.variables(given & (self.row_of < 0))
        lower, upper = fixed[bound == 1], fixed[bound == 2]
        low, high = lbx.copy(), ubx.copy()
        high[lower] = lbx[lower]
        low[upper] = ubx[upper]
        return low, high

    def fixed_by(self, zero, pairs):
        """Variables at the bounds that make the zero sides of some ``pairs`` (mask) zero."""
        return np.unique(self.fixings[np.flatnonzero(self.zero_rows(zero) & (self.row_of < 0) & np.tile(pairs, 2))].indices)

    def same_rows(self, other):
        """Whether the same sides have rows: NLPs were built for these, and for nothing else here."""
        return np.array_equal(self.row_of, other.row_of)

    def take_bounds(self, other):
        """Let sides without a row be zero at the bounds of ``other``, for the present values of parameters."""
        self.fixings = other.fixings
        self.__dict__.pop('_side', None)


def sort_sides(c) -> Sides:
    """Sort the sides of a compiled MPCC."""
    if not c.pairs:
        return Sides(np.zeros(0, dtype=int), np.zeros(0, dtype=int), sparse.csr_matrix((0, len(c.x0))))
    at, m = c.evaluate(c.x0), len(c.lbg)
    A = c.stacked_jacobian(c.x0)[m : m + 2 * c.pairs]
    # a product with a parameter that is zero now does not depend on the other factor
    A.eliminate_zeros()
    constant = np.concatenate([at.G, at.H]) - A @ c.x0
    direction, least = _least(A, c.lbx, c.ubx)
    fixable = ~c.nonlinear_sides & (np.abs(least + constant) <= EXACT)
    row_of = np.full(2 * c.pairs, -1)
    needed = np.flatnonzero(~fixable)
    _, first, row = np.unique(c.side_of[needed], return_index=True, return_inverse=True)
    row_of[needed] = row
    return Sides(needed[first], row_of, direction)


def settle(c, sides, w, zero):
    """The assignment ``zero`` without sides that other pairs decide.

    Followers get the sides of their leaders, fillings those that the extents in ``w`` show, impacts those that ``with_impacts``
    gives them.  The bounds that a branch fixes may make a side constant.  If that is zero, its pair holds, and the other side would
    only take away room.  (Both sides of such a pair are zero at many solutions, and round-off would choose.)

    Parameters
    ----------
    c : MpccFunctions
    w : array
        values of the variables that the assignment does not fix
    zero : int array (q)
    """
    zero = _without_superfluous(c, sides, w, _filled(c.fillings, w, _follow(c.followers, zero)))
    if not c.impacts:
        return zero
    return _without_superfluous(c, sides, w, with_impacts(c, zero, sides.bounds(zero, c.lbx, c.ubx)[1]))


def _without_superfluous(c, sides, w, zero):
    """The assignment in which no pair has a side at zero that need not be, as the other one is a constant zero without it."""
    given = sides.zero_rows(zero)
    fixed, settled = _constant_zeros(c, sides, w, given)
    if fixed is None or not np.any(settled):
        return zero
    superfluous = given & np.roll(settled, len(zero))
    # a row fixes nothing, so that the others settle its pair in any case; bounds may be what settles it
    rows = superfluous & (sides.row_of >= 0) & ~sides.constant(fixed)
    bounds = superfluous & (sides.row_of < 0)
    if np.any(bounds):
        without, settled = _constant_zeros(c, sides, w, given & ~bounds)
        bounds &= np.roll(settled, len(zero)) & ~sides.constant(without)
    return np.where((rows | bounds).reshape(2, -1).any(axis=0), 1 - zero, zero)


def _constant_zeros(c, sides, w, given):
    """The variables (n) that sides at zero (mask over 2q) fix, None where these contradict; and the sides that are a zero then."""
    lbx, ubx = sides.bounds_with(given, c.lbx, c.ubx)
    if np.any(lbx > ubx):
        return None, None
    constant = sides.constant(lbx == ubx)
    if np.any(constant):
        at = c.evaluate(np.clip(w, lbx, ubx))
        constant &= np.abs(np.concatenate([at.G, at.H])) <= SETTLED
    return lbx == ubx, constant


def _follow(followers, zero):
    """The assignment in which followers have the sides of their leaders."""
    new = zero.copy()
    new[followers.pairs] = _led(followers, zero)
    return new


def _filled(fillings, w, zero):
    """The assignment in which each place but the last of a filling is full; at the end of a place the side is kept."""
    new = zero.copy()
    for filling in fillings:
        extents = filling.coefficients * w[filling.extents]
        beyond = filling.amount - np.cumsum(extents)[:-1]
        clear = (np.abs(beyond) > TIE * extents.sum()) & (zero[filling.pairs] != FREE)
        new[filling.pairs[clear]] = np.where(beyond > 0, G_ZERO, H_ZERO)[clear]
    return new


def with_shares(fillings, w):
    """``w`` with the shares that the extents in it show."""
    new = w.copy()
    for filling in fillings:
        extents = filling.coefficients * w[filling.extents]
        before = filling.amount - np.concatenate([[0.0], np.cumsum(extents)[:-1]])
        new[filling.shares] = np.clip(before / np.maximum(extents, TIE * extents.sum()), 0.0, 1.0) * filling.scales
    return new


def _led(followers, zero):
    """The side that each follower gets; FREE where its leader is."""
    leading = zero[followers.leaders]
    return np.where(followers.swapped & (leading != FREE), 1 - leading, leading)


def release_followers(sets, followers, at):
    """Active sets in which followers that do not agree with their leaders are open: nothing keeps them from following."""
    zero, gamma, k = sets.zero.copy(), sets.gamma.copy(), followers.pairs
    wrong = np.where(_led(followers, zero) == G_ZERO, at.G[k], at.H[k]) > OPEN
    wrong &= ~gamma[followers.leaders]
    zero[k[wrong]], gamma[k[wrong]] = FREE, False
    return replace(sets, zero=zero, gamma=gamma)


def without_constant(sets, sides, fixed):
    """Active sets without bi-active pairs that hold by a side whose variables are all ``fixed``: they need no binary."""
    G, H = sides.constant(fixed).reshape(2, -1) & sets.gamma
    zero = np.where(G, G_ZERO, np.where(H, H_ZERO, sets.zero))
    return replace(sets, zero=zero, gamma=sets.gamma & ~(G | H))


def _least(A, lower, upper):
    """Which bound each variable takes where A w is least (csr of 1: lower, 2: upper), and that least value."""
    bound = np.where(A.data > 0, lower[A.indices], upper[A.indices])
    product = A.data * np.where(A.data == 0, 0.0, bound)
    least = np.zeros(A.shape[0])
    np.add.at(least, major_index(A), product)
    direction = sparse.csr_matrix((np.where(A.data > 0, 1.0, 2.0), A.indices, A.indptr), shape=A.shape)
    return direction, least
