"""The constraints that hold with equality at a point of an MPCC, as rows of a ``Linearisation``.

In the branch of the point one side of each pair is zero.  A pair whose both sides are zero (bi-active), and an inequality that
holds with equality, are *open*: multipliers, or the derivative itself, decide whether they stay as they are.
"""

from dataclasses import dataclass, replace

import numpy as np

from pyomo_fesd.mpcc import FREE, active_sets, settle, without_constant

#: Where something is minimised, Ipopt leaves an inequality without a multiplier at the root of its complementarity tolerance.
NEAR = 2e-5


@dataclass(frozen=True)
class ActiveRows:
    """The active rows of a point.

    Attributes
    ----------
    rows : int array, rows of the ``Linearisation``
    side : array, +1 where the upper bound holds or for an equation, -1 where the lower bound holds
    open : bool array, inequalities and both sides of bi-active pairs
    fixed : int array (n), -1 or +1 where the branch fixes a variable at its lower or upper bound, else 0
    names : list of str
    """

    rows: np.ndarray
    side: np.ndarray
    open: np.ndarray
    fixed: np.ndarray
    names: list

    def settled(self, holds):
        """The same with the rows of mask ``holds`` as equations."""
        return replace(self, open=self.open & ~holds)


def active_rows(c, sides, w, near, eta, name) -> ActiveRows:
    """Read the active rows at ``w``.

    Parameters
    ----------
    c : MpccFunctions
    sides : Sides
    near : float
        scaled distance from a bound, and value of a side, below which it is active
    eta : float
        value above which a decision is in force
    name : callable
        the user's name of a component
    """
    at = c.evaluate(w)
    sets = active_sets(at.G, at.H, near)
    sets = replace(sets, zero=settle(c, sides, w, sets.zero))
    # a bi-active pair is open: none of its sides fixes a variable
    lower, upper = sides.bounds(_decided(sets), c.lbx, c.ubx)
    sets = without_constant(sets, sides, lower == upper)
    zero = _decided(sets)
    lower, upper = sides.bounds(zero, c.lbx, c.ubx)
    m, q, e = len(c.lbg), len(zero), c.equal.numel()
    is_zero = sides.zero_rows(zero) & (sides.row_of >= 0)
    decided = np.flatnonzero((at.eta > eta) & (np.abs(c.decided(w)) <= near))
    pairs = np.concatenate([sets.gamma, sets.gamma])
    free = lower < upper
    found = [
        *_bounded(0, at.g, c.lbg, c.ubg, near),
        (m + _once(is_zero, sides.row_of), 1.0, False),
        (m + np.flatnonzero(pairs), -1.0, True),
        (m + 2 * q + decided, 1.0, False),
        *((rows[free[rows - m - 2 * q - e]], s, o) for rows, s, o in _bounded(m + 2 * q + e, w, c.lbx, c.ubx, near)),
    ]
    rows, side, is_open = (np.concatenate([np.broadcast_to(f[i], f[0].shape) for f in found]) for i in range(3))
    at_upper = ~free & (upper == c.ubx) & (lower != c.lbx)
    names = _Names(c, name)
    return ActiveRows(rows, side, is_open, np.where(free, 0, np.where(at_upper, 1, -1)), [names(row) for row in rows])


def _decided(sets):
    """Zero sides of the pairs, none of bi-active ones."""
    return np.where(sets.gamma, FREE, sets.zero)


def _bounded(first, values, low, high, near):
    """Equations, and inequalities at a bound, with the number of the ``first`` row."""
    equation = low == high
    yield first + np.flatnonzero(equation), 1.0, False
    yield first + np.flatnonzero(~equation & (values - low <= near)), -1.0, True
    yield first + np.flatnonzero(~equation & (high - values <= near)), 1.0, True


def _once(is_zero, row_of):
    """Positions of zero sides, those that several pairs share once."""
    found = np.flatnonzero(is_zero)
    return found[np.unique(row_of[found], return_index=True)[1]]


class _Names:
    """Names of rows of a ``Linearisation``."""

    def __init__(self, c, name):
        sources = [condition.source for condition in c.conditions]
        self._components = [*c.constraints, *sources, *sources, *(d.constraint for d in c.decisions), *c.variables]
        self._name = name

    def __call__(self, row):
        return self._name(self._components[row])
