"""Compiled residuals of one element class, or of the first time.

    equations = 0;   sides G, H of every condition, and event functions, at every label;   signs of all other generated rows

All are in the solver's scaling (``element_functions``), with exact sparse derivatives.

Does not apply: where a condition exists at some labels of an element only or is stated twice, and to functions that casadi does
not have (``complete`` is False).
"""

from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np

from pyomo_fesd.core import interpolation_weights
from pyomo_fesd.simulation.casadi_expressions import Unsupported
from pyomo_fesd.simulation.element_equations import ElementEquations
from pyomo_fesd.simulation.element_functions import ElementFunctions


class _Stack(list):
    """Entries of V, one below the other: ``(numbers, weights)`` of the expressions of which each is the sum."""

    def push(self, numbers: Iterable[int]) -> np.ndarray:
        """Append the expressions with these ``numbers``; returns their rows."""
        return self.push_sums(([k] for k in numbers), [1.0])

    def push_sums(self, numbers: Iterable[Sequence[int]], weights: Sequence[float]) -> np.ndarray:
        """Append sums of expressions with ``weights``; returns their rows."""
        begin = len(self)
        self.extend((some, weights) for some in numbers)
        return np.arange(begin, len(self))

    def matrix(self, factors: np.ndarray) -> ca.DM:
        """The matrix that makes V of all expressions, which have these ``factors``."""
        rows = [row for row, (numbers, _) in enumerate(self) for _ in numbers]
        columns = [k for numbers, _ in self for k in numbers]
        entries = [weight * factors[k] for numbers, weights in self for k, weight in zip(numbers, weights)]
        return ca.DM.triplet(rows, columns, ca.DM(entries), len(self), factors.size)


class ElementResiduals:
    """Compiled functions V of w (unknowns) and p (known values), for the class of ``pattern`` and collocation points ``tau``.

    Function k is side G of condition i for k = 2 i, its side H for k = 2 i + 1; then the event functions follow.

    Attributes
    ----------
    names : list of str
        conditions
    complete : bool
        whether every condition exists once at every label; the other attributes are only set if so
    equations : int array
        rows of V with the residuals of equations
    functions : int array (functions, labels)
        rows with the values of the functions
    starts, ends : int array (functions)
        rows with their values right of the left boundary, where unknowns of their own belong to it, else -1; at the right boundary
    others : int array
        rows with further signs
    cross : int array (2, pairs)
        rows with both sides of the aggregated pairs
    continuous, repeated : bool array (functions)
        whether a function is continuous in time; if not, and the right boundary is not a collocation point, its last entry in
        ``functions`` repeats the one before, and the row in ``ends`` extrapolates
    lower, upper : arrays
        bounds of w
    length : int or None
        position of the length multiplier in w
    """

    def __init__(self, pattern: ElementEquations, tau: Sequence[float], user_scaling: bool = True):
        self.complete = all(found.number in (0, len(pattern.labels)) for found in pattern.point_pairs.values())
        self.complete = self.complete and not _repeated_pairs(pattern)
        if self.complete:
            try:
                functions = ElementFunctions(pattern, user_scaling)
            except Unsupported:
                self.complete = False
            else:
                self._take(functions, pattern, tau)

    def _take(self, functions, pattern, tau):
        """Take the expressions of the class."""
        self._order, self._s_x, self.lower, self.upper = functions.order, functions.s_x, functions.lower, functions.upper
        position = {id(pattern.unknown[k]): j for j, k in enumerate(functions.order.tolist())}
        self.length = None if pattern.length is None else position.get(id(pattern.length))
        self.names = list(functions.points)
        if self.length is not None:
            self.lower[self.length], self.upper[self.length] = -np.inf, np.inf
            self.complete = self._s_x[self.length] == 1.0
        self._assemble(functions, [pattern.point_pairs[name] for name in self.names], len(pattern.labels), tau)

    def _assemble(self, functions, points, labels, tau):
        """Stack the entries of V, remember their rows, and compile; those up to the ends have derivatives."""
        stack = _Stack()
        sides, starts = _sides(functions, labels)
        self.equations = stack.push(functions.equations)
        self.functions = stack.push([*sides, *functions.events]).reshape(-1, labels)
        self.continuous = np.ones(len(self.functions), dtype=bool)
        self.continuous[: 2 * len(points)] = [s for found in points for s in found.continuous]
        self.repeated = ~self.continuous & (tau[-1] != 1)
        self.starts, self.ends = np.full(len(self.functions), -1), self.functions[:, -1].copy()
        self.starts[list(starts)] = stack.push(starts.values())
        at_one = interpolation_weights(tau, np.ones(len(tau))).ravel().tolist()
        rows = ([stack[i][0][0] for i in row] for row in self.functions[self.repeated, :-1])
        self.ends[self.repeated] = stack.push_sums(rows, at_one)
        differentiated = len(stack)
        # the signs of all that follow are checked only
        self.others = stack.push(functions.others)
        self.cross = stack.push(pair[side] for side in (0, 1) for pair in functions.cross).reshape(2, -1)
        self._compile(functions, stack.matrix(functions.factors), differentiated)

    def _compile(self, functions, matrix, differentiated):
        x, p = functions.x, functions.p
        V, J = ca.mtimes(matrix, functions.V), ca.mtimes(matrix[:differentiated, :], functions.slopes)
        function = ca.Function('element', [x, p], [ca.densify(V), J])
        self.rows = np.array(J.sparsity().row(), dtype=int)
        self.columns = np.repeat(np.arange(x.numel()), np.diff(J.sparsity().colind()))
        self._scale_of_entries = None if np.all(self._s_x == 1.0) else self._s_x[self.columns]
        self._x, self._p = np.zeros(x.numel()), np.zeros(max(1, p.numel()))
        self.V, self._J = np.zeros(max(1, V.numel())), np.zeros(max(1, self.rows.size))
        self._buffer, self._evaluate = function.buffer()
        for number, array in enumerate((self._x, self._p)):
            self._buffer.set_arg(number, memoryview(array))
        for number, array in enumerate((self.V, self._J)):
            self._buffer.set_res(number, memoryview(array))

    def set_known(self, values: Sequence[float]) -> None:
        """Take the known values."""
        self._p[: len(values)] = values

    def evaluate(self, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return V at ``w`` and the entries of its Jacobian at ``rows`` and ``columns``, valid until the next call."""
        self._x[:] = w if self._scale_of_entries is None else w / self._s_x
        self._evaluate()
        if self._scale_of_entries is not None:
            self._J[: self.rows.size] /= self._scale_of_entries
        return self.V, self._J

    def point(self, values: Sequence[float | None]) -> np.ndarray:
        """Return w for values of the unknowns; 0 for a missing value."""
        found = np.array(values, dtype=float)[self._order]
        return np.where(np.isfinite(found), found, 0.0) * self._s_x

    def values(self, w: np.ndarray, before: Sequence[float | None]) -> list:
        """Return the values of the unknowns; those that no function contains stay as ``before``."""
        found = list(before)
        for k, number in zip(self._order.tolist(), (w / self._s_x).tolist()):
            found[k] = number
        return found


def _repeated_pairs(pattern):
    """Whether two conditions at points are one, as their equations would be."""
    sides = [frozenset(map(id, pair)) for found in pattern.point_pairs.values() for pair in found.pairs]
    return len(set(sides)) < len(sides)


def _sides(functions, labels):
    """Both sides of every condition at all labels; and, by function, right of the left boundary if that contains unknowns."""
    sides, starts = [], {}
    for both in functions.points.values():
        for S in both:
            starts |= {len(sides) // labels: side for side in S[labels:] if functions.depends[side]}
            sides += S[:labels]
    return sides, starts
