"""Functions of many rows with exact sparse derivatives: a matrix for what is linear, classes of equal form for the rest.

    V(x) = A x + b + nonlinear parts

Each class is derived once; sums by index add its values, slopes and curvatures to their rows and entries.  x may be numbers (DM) or
symbols: SX, whose functions are fast and slow to make, or MX, in which a class is one node whatever its number of instances.

Takes: A, b, classes.
Leaves: values, Jacobian and the upper triangle of the Hessian.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.compile.casadi_matrices import csr, dm
from pyomo_fesd.mpcc.compile.row_classes import RowClass, without_cache


@dataclass(frozen=True, eq=False)
class RowFunctions:
    """V with N rows of some variables, of which the first ``free`` ones are not parameters.

    Attributes
    ----------
    linear : csr (N, variables), A
    constants : array (N), b
    classes : list of RowClass
    free : int
    """

    linear: object
    constants: np.ndarray
    classes: list[RowClass]
    free: int

    __getstate__, __setstate__ = without_cache

    def values(self, x):
        """V at ``x``, a dense column."""
        kind = type(x)
        found = kind(ca.DM(self.constants.tolist()))
        if self.linear.nnz:
            found = kind.binary(ca.OP_ADD, found, ca.mtimes(self._matrix, x))
        if self.classes:
            parts = ca.mtimes(self._places, ca.vertcat(*(k.values(x) for k in self.classes)))
            found = kind.binary(ca.OP_ADD, found, parts)
        return ca.densify(found)

    def jacobian(self, x):
        """Jacobian of V by the free variables at ``x``."""
        return self._slopes[0].matrix(self._all_slopes(x))

    def jacobian_by_parameters(self, x):
        """Jacobian of V by the parameters at ``x``."""
        return self._slopes[1].matrix(self._all_slopes(x))

    def hessian(self, x, factors):
        """Upper triangle of the Hessian of ``factors' V`` by the free variables at ``x``."""
        return self._curvatures.matrix(ca.vertcat(type(x)(0, 1), *(k.curvatures(x, factors) for k in self.classes)))

    def parameter_terms(self, x) -> np.ndarray:
        """Sizes of the terms of the parameters in each row at ``x`` (DM)."""
        if self.linear.shape[1] == self.free:
            return np.zeros(len(self.constants))
        J = csr(self.jacobian_by_parameters(x))
        return np.nan_to_num(abs(J) @ np.abs(x[self.free :].full().ravel()), posinf=0.0)

    @property
    def is_linear(self) -> bool:
        """Whether there are no nonlinear parts."""
        return not self.classes

    @property
    def coefficients(self):
        """The free variables' part of A (csr): the Jacobian of linear functions."""
        return self.linear if self.linear.shape[1] == self.free else self.linear[:, : self.free]

    @cached_property
    def nonlinear(self) -> np.ndarray:
        """Mask over the rows that are not linear in the free variables."""
        mask = np.zeros(len(self.constants), dtype=bool)
        for k in self.classes:
            mask[k.rows[k.nonlinear]] = True
        return mask

    @property
    def size(self) -> int:
        """Operations of all instances, and linear coefficients."""
        return self.linear.nnz + sum(k.columns.shape[1] * k.value.n_instructions() for k in self.classes)

    def _all_slopes(self, x):
        return ca.vertcat(type(x)(0, 1), *(k.slopes(x) for k in self.classes))

    @cached_property
    def _matrix(self):
        return dm(self.linear)

    @cached_property
    def _places(self):
        """Ones where the values of the classes belong, a column each."""
        rows = np.concatenate([k.rows.ravel() for k in self.classes]).tolist()
        return ca.DM(ca.Sparsity(len(self.constants), len(rows), list(range(len(rows) + 1)), rows), 1.0)

    @cached_property
    def _slopes(self):
        """The sums of the free variables' slopes and of the parameters'."""
        rows, columns = _together(k.slope_places for k in self.classes)
        of_free, (m, n), A = columns < self.free, self.linear.shape, self.linear.tocoo()
        inside = A.col < self.free
        by_free = A.row[inside], A.col[inside], A.data[inside]
        by_parameters = A.row[~inside], A.col[~inside] - self.free, A.data[~inside]
        return (
            _Sum((m, self.free), rows, columns, of_free, by_free),
            _Sum((m, n - self.free), rows, columns - self.free, ~of_free, by_parameters),
        )

    @cached_property
    def _curvatures(self):
        return _Sum((self.free, self.free), *_together(k.curvature_places for k in self.classes))


#: No entries: rows, columns, numbers.
_NOTHING = np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros(0)


class _Sum:
    """Adds numbers to the entries of a sparse matrix.

    Parameters
    ----------
    shape : (int, int)
    rows, columns : int arrays, the entry of each number
    used : bool array, optional
        numbers that belong to this matrix
    base : (rows, columns, numbers), optional
        added as well
    """

    def __init__(self, shape, rows, columns, used=None, base=None):
        used = np.arange(len(rows)) if used is None else np.flatnonzero(used)
        base_rows, base_columns, base_numbers = _NOTHING if base is None else base
        flat = np.concatenate([columns[used], base_columns]) * np.int64(shape[0]) + np.concatenate([rows[used], base_rows])
        places, entry = np.unique(flat, return_inverse=True)
        column, row = np.divmod(places, max(1, shape[0]))
        ends = np.searchsorted(column, np.arange(shape[1] + 1))
        self._sparsity = ca.Sparsity(*shape, ends.tolist(), row.tolist())
        self._base = ca.DM(np.bincount(entry[len(used) :], base_numbers, len(places)).tolist())
        # one entry in the column of each number that is used
        before = np.searchsorted(used, np.arange(len(rows) + 1))
        self._terms = ca.DM(ca.Sparsity(len(places), len(rows), before.tolist(), entry[: len(used)].tolist()), 1.0)

    def matrix(self, numbers):
        """The matrix of ``numbers`` (a column)."""
        kind = type(numbers)
        if not self._terms.nnz():
            return kind(ca.DM(self._sparsity, self._base))
        return kind(self._sparsity, ca.densify(kind(self._base) + ca.mtimes(self._terms, numbers)))


def _together(places):
    """Rows and columns of all classes."""
    places = list(places)
    return tuple(np.concatenate([np.zeros(0, dtype=int), *(both[k] for both in places)]) for k in (0, 1))
