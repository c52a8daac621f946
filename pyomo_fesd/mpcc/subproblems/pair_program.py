"""A linearised LPEC whose pairs have zero sides, or none yet.

The last rows of its program are the sides G, then H, of the bi-active pairs, each from minus its value at the point.  Before them
are rows that hold where zero sides make some variables zero: the drift of a curved contact is 0 in an open element, its rate in a
closed one.  Their weighted equation (eq. 22), which has no derivative where both may be, is left out.

Takes: a program, active sets, and the contacts' ``DriftIndices``.
Leaves: the program with such rows, and its upper bounds with zero sides of the pairs.
"""

from dataclasses import replace

import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.subproblems.active_set import FREE, G_ZERO, H_ZERO
from pyomo_fesd.mpcc.subproblems.impact_sides import gone


class PairProgram:
    """The program of one LPEC.

    Parameters
    ----------
    program : Program
    pairs : int
        number of bi-active pairs
    drifts : list of DriftIndices
        those that these pairs decide
    zeros : callable (sides) -> bool array (n)
        the variables that are zero with these sides of the pairs, ``FREE`` for a pair without one

    Attributes
    ----------
    program : Program
        with two rows more for each drift and each rate
    pairs : int
    last : slice
        rows of the sides
    """

    def __init__(self, program, pairs, drifts=(), zeros=None):
        cut, n = len(program.low) - 2 * pairs, len(program.cost)
        columns = np.array([j for drift in drifts for j in (drift.drift, drift.rate)], dtype=int)
        self._drifts, self._zeros, self.pairs = list(drifts), zeros, pairs
        self.more = slice(cut, cut + 2 * len(columns))
        self.last = slice(cut + 2 * len(columns), None)
        own = sparse.csr_matrix((np.ones(len(columns)), (np.arange(len(columns)), columns)), (len(columns), n))
        A = sparse.vstack([program.A[:cut], own, -own, program.A[cut:]], format='csr') if len(columns) else program.A
        free = np.full(2 * len(columns), np.inf)
        low, high = (np.insert(old, cut, new) for old, new in ((program.low, -free), (program.high, free)))
        self.program = replace(program, A=A, low=low, high=high)

    def upper_bounds(self, sides):
        """Upper bounds of the rows with these zero sides of the pairs."""
        high = self.program.high.copy()
        high[self.last] = np.where(np.concatenate([sides == G_ZERO, sides == H_ZERO]), 0.0, np.inf)
        if self._drifts:
            is_zero = self._zeros(sides)
            fixed = [j == gone(drift, is_zero) for drift in self._drifts for j in (drift.drift, drift.rate)]
            high[self.more] = np.where(np.tile(fixed, 2), 0.0, np.inf)
        return high

    def with_sides(self, sides):
        """The program with these zero sides of the pairs."""
        return replace(self.program, high=self.upper_bounds(sides))

    def own(self, y):
        """Multipliers without those of the rows that are no rows of the LPEC."""
        return np.delete(y, self.more) if self._drifts else y


def undecided(drifts, zeros, pairs):
    """The drifts of which the pairs decide what is zero."""
    if not drifts:
        return []
    free = zeros(np.full(pairs, FREE))
    most = zeros(np.full(pairs, G_ZERO)) | zeros(np.full(pairs, H_ZERO))
    return [drift for drift in drifts if gone(drift, free) is None and gone(drift, most) is not None]
