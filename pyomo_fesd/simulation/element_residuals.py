"""Compiled residuals of one element class, or of the first time.

    equations = 0;   sides G, H of every condition, and event functions, at every label;   signs of all other generated rows

All are in the solver's scaling, with exact sparse derivatives; the graph is that of ``mpcc.compile``.

Does not apply: where a condition exists at some labels of an element only (``complete`` is False).
"""

from collections.abc import Iterable, Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from pyomo_fesd.core import interpolation_weights
from pyomo_fesd.mpcc import compile_mpcc, read_mpcc
from pyomo_fesd.simulation.element_equations import ElementEquations
from pyomo_fesd.simulation.element_model import ElementModel


class _Stack(list):
    """Entries of V, one below the other."""

    def push(self, entries: Iterable) -> np.ndarray:
        """Append ``entries``; returns their rows."""
        begin = len(self)
        self.extend(entries)
        return np.arange(begin, len(self))


class ElementResiduals:
    """Compiled functions V of w (unknowns) and p (known values), for the class of ``pattern`` and collocation points ``tau``.

    Function k is side G of condition i for k = 2 i, its side H for k = 2 i + 1; then the event functions follow.

    Attributes
    ----------
    names : list of str
        conditions
    complete : bool
        whether every condition exists at every label; the following attributes are only set if so
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

    def __init__(self, pattern: ElementEquations, tau: Sequence[float], timer, user_scaling: bool = True):
        copy = ElementModel(pattern)
        points = {name: found for name, found in pattern.point_pairs.items() if found.number}
        copy.add_pairs('point', [pair for found in points.values() for pair in found.pairs])
        copy.add_pairs('cross', pattern.cross_pairs)
        known = list(copy.model.known.values())
        self._c = c = compile_mpcc(
            read_mpcc(copy.model), timer, parameters=known, user_scaling=user_scaling, natural_units='starts', expanded=True
        )
        self._order = np.array([v.index() for v in c.variables], dtype=int)
        self.length = next((j for j, v in enumerate(c.variables) if v is copy.length), None)
        self.lower, self.upper = c.lbx.copy(), c.ubx.copy()
        if self.length is not None:
            self.lower[self.length], self.upper[self.length] = -np.inf, np.inf
        self.names = list(points)
        self.complete = self._is_complete(pattern, points)
        if self.complete:
            self._assemble(copy, points, len(pattern.labels), tau)

    def _is_complete(self, pattern, points):
        pairs = sum(len(found.pairs) for found in points.values())
        return (
            (self.length is None or self._c.scale.x[self.length] == 1.0)
            and all(found.number == len(pattern.labels) for found in points.values())
            and pairs == sum(1 for name, _ in self._conditions if name == 'point')
        )

    @cached_property
    def _conditions(self):
        """Position of each pair of the model among the compiled ones, which leave out repetitions."""
        return {(d.source.parent_component().local_name, d.source.index()): k for k, d in enumerate(self._c.conditions)}

    def _assemble(self, copy, points, labels, tau):
        """Stack the entries of V, remember their rows, and compile; those up to the ends have derivatives."""
        c, stack = self._c, _Stack()
        sides, starts = self._sides(points, labels)
        events = self._event_functions(copy)
        self.equations = stack.push(_above(c, np.flatnonzero(c.lbg == c.ubg)))
        self.functions = stack.push([*sides, *_above(c, events)]).reshape(-1, labels)
        self.continuous = np.ones(len(self.functions), dtype=bool)
        self.continuous[: 2 * len(points)] = [s for found in points.values() for s in found.continuous]
        self.repeated = ~self.continuous & (tau[-1] != 1)
        self.starts, self.ends = np.full(len(self.functions), -1), self.functions[:, -1].copy()
        self.starts[list(starts)] = stack.push(starts.values())
        at_one = ca.DM(interpolation_weights(tau, np.ones(len(tau))))
        rows = [ca.vertcat(*(stack[i] for i in row)) for row in self.functions[self.repeated, :-1]]
        self.ends[self.repeated] = stack.push(ca.dot(at_one, row) for row in rows)
        differentiated = len(stack)
        self._stack_checks(stack, events)
        self._compile(ca.vertcat(*stack) if stack else ca.SX(0, 1), differentiated)

    def _stack_checks(self, stack, events):
        """Stack entries whose signs are checked only."""
        c = self._c
        others = c.lbg < c.ubg
        others[events] = False
        below = [c.ubg[i] - c.g[i] for i in np.flatnonzero(others & np.isfinite(c.ubg)).tolist()]
        self.others = stack.push([*_above(c, np.flatnonzero(others & np.isfinite(c.lbg))), *below])
        cross = [k for (name, _), k in self._conditions.items() if name == 'cross']
        self.cross = stack.push(S[k] for S in (c.G, c.H) for k in cross).reshape(2, -1)

    def _sides(self, points, labels):
        """Both sides of every condition at all labels; and, by function, right of the left boundary if that contains unknowns."""
        c, numbers = self._c, iter(range(len(self._conditions)))
        sides, starts = [], {}
        for found in points.values():
            at = [self._conditions['point', next(numbers)] for _ in found.pairs]
            for S in (c.G, c.H):
                starts |= {len(sides) // labels: S[k] for k in at[labels:] if ca.depends_on(S[k], c.x)}
                sides += [S[k] for k in at[:labels]]
        return sides, starts

    def _event_functions(self, copy):
        """Numbers of the compiled constraints of all event functions with unknowns."""
        numbers = {id(row): i for i, row in enumerate(self._c.constraints)}
        return [numbers[id(row)] for rows in copy.event_rows if all(id(row) in numbers for row in rows) for row in rows]

    def _compile(self, V, differentiated):
        c, J = self._c, ca.jacobian(V[:differentiated], self._c.x)
        function = ca.Function('element', [c.x, c.p], [V, J])
        self.rows = np.array(J.sparsity().row(), dtype=int)
        self.columns = np.repeat(np.arange(c.x.numel()), np.diff(J.sparsity().colind()))
        self._w, self._p = np.zeros(c.x.numel()), np.zeros(max(1, c.p.numel()))
        self.V, self._J = np.zeros(max(1, V.numel())), np.zeros(max(1, self.rows.size))
        self._buffer, self._evaluate = function.buffer()
        for number, array in enumerate((self._w, self._p)):
            self._buffer.set_arg(number, memoryview(array))
        for number, array in enumerate((self.V, self._J)):
            self._buffer.set_res(number, memoryview(array))

    def set_known(self, values: Sequence[float]) -> None:
        """Take the known values."""
        self._p[: len(values)] = values

    def evaluate(self, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return V at ``w`` and the entries of its Jacobian at ``rows`` and ``columns``, valid until the next call."""
        self._w[:] = w
        self._evaluate()
        return self.V, self._J

    def point(self, values: Sequence[float | None]) -> np.ndarray:
        """Return w for values of the unknowns; 0 for a missing value."""
        found = np.array(values, dtype=float)[self._order]
        return np.where(np.isfinite(found), found, 0.0) * self._c.scale.x

    def values(self, w: np.ndarray, before: Sequence[float | None]) -> list:
        """Return the values of the unknowns; those that no function contains stay as ``before``."""
        found = list(before)
        for k, number in zip(self._order.tolist(), (w / self._c.scale.x).tolist()):
            found[k] = number
        return found


def _above(c, rows):
    """Distances of constraints from their lower bounds."""
    return [c.g[i] - c.lbg[i] for i in np.asarray(rows, dtype=int).tolist()]
