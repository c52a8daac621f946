"""Rows of equal form: one casadi function, derived once and evaluated for all of them.

    v = F(s, c),   s = x[I] (a variables of each instance),   c (constants of each instance)

Takes: a function of the variables and constants of one instance, and index arrays.
Leaves: values, slopes and curvatures of all instances with their coordinates, at numbers (DM) or symbols (SX, MX).
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from pyomo_fesd.mpcc.compile.elementwise import elementwise

#: With more operations than so many times its instances, a function is called for one instance after the other: a node of MX for
#: each operation takes longer then, and much longer to make.
LONG = 10


def _fields(self):
    return {name: getattr(self, name) for name in self.__dataclass_fields__}


def _restore(self, state):
    self.__dict__.update(state)


#: ``__getstate__`` and ``__setstate__`` of a dataclass without its cached properties.
without_cache = _fields, _restore


@dataclass(frozen=True, eq=False)
class RowClass:
    """n instances of a function with one value, or one of a function with several.

    Attributes
    ----------
    value : casadi Function (s (a), c) -> v (o), on SX
    rows : int array (o, n), where the values belong
    columns : int array (a, n), the variables
    constants : array (l, n)
    free : bool array (a), variables; the others are parameters, of which there are no second derivatives
    """

    value: object
    rows: np.ndarray
    columns: np.ndarray
    constants: np.ndarray
    free: np.ndarray

    __getstate__, __setstate__ = without_cache

    def values(self, x):
        """Column of the values of all instances, in the order of ``rows``."""
        return self._of_all(self.value, x)

    @property
    def nonlinear(self) -> np.ndarray:
        """Mask (o) over the values that are not linear in the variables."""
        s, _, v = self._symbolic
        return np.array(ca.which_depends(v, s[np.flatnonzero(self.free).tolist()], 2, True), dtype=bool)

    @property
    def slope_places(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of ``slopes``."""
        _, row, slot = self._slope
        return self.rows[row].ravel(), self.columns[slot].ravel()

    def slopes(self, x):
        """Column of the first derivatives by all variables."""
        return self._of_all(self._slope[0], x)

    @property
    def curvature_places(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of ``curvatures``, in the upper triangle."""
        _, first, second = self._curvature
        both = self.columns[first].ravel(), self.columns[second].ravel()
        return np.minimum(*both), np.maximum(*both)

    def curvatures(self, x, factors):
        """Column of the second derivatives of the sum of all values times ``factors``, which are by row."""
        return self._of_all(self._curvature[0], x, factors[self.rows.ravel().tolist()])

    def _of_all(self, function, x, *factors):
        """Column of the outputs of all instances, those of one output together."""
        kind, count = type(x), self.columns.shape[1]
        if function.numel_out(0) == 0:
            return kind(0, 1)
        if count == 1 or function.n_instructions() > LONG * count:
            return self._by_calls(function, x, *factors)
        s = [x[columns.tolist()] for columns in self.columns]
        constants = [kind(ca.DM(numbers.tolist())) for numbers in self.constants]
        return ca.vertcat(*elementwise(function, [s, constants, *([f] for f in factors)], count))

    def _by_calls(self, function, x, *factors):
        """The same by one call for each instance."""
        (a, count), outputs = self.columns.shape, function.numel_out(0)
        s, constants = x[self.columns.T.ravel().tolist()], ca.DM(self.constants)
        if count == 1:
            return ca.vec(function(s, constants, *factors))
        found = function.map(count)(ca.reshape(s, a, count), constants, *(ca.reshape(f, 1, count) for f in factors))
        return ca.vec(ca.reshape(found, outputs, count).T)

    @cached_property
    def _symbolic(self):
        """Symbols of one instance: s, c and v."""
        s, c = (self.value.sx_in(k) for k in (0, 1))
        return s, c, ca.densify(self.value(s, c))

    @cached_property
    def _slope(self):
        s, c, v = self._symbolic
        return self._nonzeros('slope', [s, c], ca.jacobian(v, s))

    @cached_property
    def _curvature(self):
        s, c, v = self._symbolic
        factors, free = ca.SX.sym('lam', v.numel()), np.flatnonzero(self.free)
        hessian = ca.hessian(ca.dot(factors, v), s[free.tolist()])[0] if free.size else ca.SX(0, 0)
        function, first, second = self._nonzeros('curvature', [s, c, factors], ca.triu(hessian))
        return function, free[first], free[second]

    @staticmethod
    def _nonzeros(name, inputs, matrix):
        """Function with the nonzeros of ``matrix``, and their rows and columns."""
        row, column = (np.array(part, dtype=int) for part in matrix.sparsity().get_triplet())
        return ca.Function(name, inputs, [matrix.nz[:]]), row, column
