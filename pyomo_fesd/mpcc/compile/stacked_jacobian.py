"""casadi's Jacobians one upon another as one scipy matrix, of which each block is a part without a copy.

Takes: sparsities of blocks, once; their nonzeros in casadi's order at each point.
Leaves: the stacked csr matrix and its parts.  All of them share the arrays of indices, so nobody may change these.
"""

import numpy as np
from scipy import sparse

from pyomo_fesd.mpcc.compile.sparse_entries import with_entries


class StackedJacobian:
    """The pattern of stacked blocks.

    Parameters
    ----------
    sparsities : list of casadi Sparsity, with equal numbers of columns
    heights : list of int
        rows of each part; they add up to those of all blocks
    """

    def __init__(self, sparsities, heights):
        firsts = np.cumsum([0, *(pattern.size1() for pattern in sparsities)])
        places = [pattern.get_triplet() for pattern in sparsities]
        row = np.concatenate([np.array(rows, dtype=np.int32) + first for (rows, _), first in zip(places, firsts)])
        column = np.concatenate([np.array(columns, dtype=np.int32) for _, columns in places])
        self._order = np.lexsort((column, row))
        ends = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=firsts[-1]))]).astype(np.int32)
        shape = int(firsts[-1]), sparsities[0].size2()
        self._all, limits = _matrix(column[self._order], ends, shape), np.cumsum([0, *heights])
        self._parts = []
        for first, end in zip(limits, limits[1:]):
            inside = slice(int(ends[first]), int(ends[end]))
            part = _matrix(self._all.indices[inside], ends[first : end + 1] - ends[first], (int(end - first), shape[1]))
            self._parts.append((inside, part))

    @property
    def nonzeros(self) -> list[int]:
        """Number of entries of each part."""
        return [part.nnz for _, part in self._parts]

    def at(self, numbers):
        """Return the stacked matrix with casadi's nonzeros ``numbers`` of all blocks, and its parts."""
        stacked = with_entries(self._all, numbers[self._order])
        return stacked, *(with_entries(part, stacked.data[inside]) for inside, part in self._parts)


def _matrix(indices, ends, shape):
    matrix = sparse.csr_matrix((np.zeros(len(indices)), indices, ends), shape=shape)
    matrix.has_sorted_indices = matrix.has_canonical_format = True
    return matrix
