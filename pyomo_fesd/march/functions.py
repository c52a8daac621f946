"""One kind of element, or the first time, as compiled functions: what must vanish, and what must not become negative.

    equations = 0;      sides G, H of every condition and limits, at every label;      signs of all else that is generated

All are in the solver's scaling, with exact sparse derivatives; the graph is that of ``mpcc.compile``.

Takes: ``Equations``.
Leaves: nothing.
Does not apply: where a condition is there at some labels of an element only (``complete`` is False).
"""

from functools import cached_property

import casadi as ca
import numpy as np

from pyomo_fesd.march.scene import Scene
from pyomo_fesd.mpcc.compile import compile_problem
from pyomo_fesd.mpcc.problem import read_problem


class Functions:
    """Compiled functions V of w (unknowns) and p (known values).

    Function k is side G of condition i for k = 2 i, its side H for k = 2 i + 1; then the limits follow.

    Parameters
    ----------
    pattern : Equations
    timer : HierarchicalTimer
    user_scaling : bool

    Attributes
    ----------
    names : list of str
        conditions
    complete : bool
        whether all is there at every label; the rest is only set if so
    vanishing : int array
        rows of V with the residuals of equations
    signed : int array (functions, labels)
        rows with the values of the functions
    starts : int array (functions)
        rows with their values right of the left boundary, where unknowns of their own belong to it; else -1
    others : slice
        rows with further signs
    cross : int array (2, pairs)
        rows with both sides of the aggregated pairs
    continuous : bool array (functions)
        sides that are continuous in time
    lower, upper : arrays
        bounds of w
    length : int or None
        place of the length multiplier in w
    """

    def __init__(self, pattern, timer, user_scaling=True):
        scene, there = Scene(pattern), {name: points for name, points in pattern.points.items() if points.labels}
        scene.add_pairs('point', [pair for points in there.values() for pair in points.pairs])
        scene.add_pairs('pair', pattern.pairs)
        known = list(scene.model.known.values())
        self._c = c = compile_problem(read_problem(scene.model), timer, parameters=known, user_scaling=user_scaling)
        self._places = np.array([v.index() for v in c.variables], dtype=int)
        self.length = next((j for j, v in enumerate(c.variables) if v is scene.length), None)
        self.lower, self.upper = c.lbx.copy(), c.ubx.copy()
        if self.length is not None:
            self.lower[self.length], self.upper[self.length] = -np.inf, np.inf
        self.names = list(there)
        self.complete = self._is_complete(pattern, there)
        if self.complete:
            self._collect(scene, pattern, there)

    def _is_complete(self, pattern, there):
        stands = sum(len(points.pairs) for points in there.values())
        return (
            (self.length is None or self._c.scale.x[self.length] == 1.0)
            and all(points.labels == len(pattern.labels) for points in there.values())
            and stands == sum(1 for name, _ in self._conditions if name == 'point')
        )

    @cached_property
    def _conditions(self):
        """Where each pair of the scene stands; one that says the same as another does not."""
        return {(d.source.parent_component().local_name, d.source.index()): k for k, d in enumerate(self._c.conditions)}

    def _collect(self, scene, pattern, there):
        """Put V together."""
        c, L, count = self._c, len(pattern.labels), iter(range(len(self._conditions)))
        sides, starts, begins = [], [], []
        for points in there.values():
            places = [self._conditions['point', next(count)] for _ in points.pairs]
            for S in (c.G, c.H):
                sides += [S[k] for k in places[:L]]
                begin = S[places[L]] if len(places) > L else ca.SX(0)
                has = ca.depends_on(begin, c.x)
                begins.append(len(starts) if has else -1)
                starts += [begin] if has else []
        at = {id(row): i for i, row in enumerate(c.constraints)}
        limits = [[at[id(row)] for row in rows] for rows in scene.rows.values() if all(id(row) in at for row in rows)]
        limiting = {i for rows in limits for i in rows}
        rest = [i for i in range(len(c.constraints)) if c.lbg[i] < c.ubg[i] and i not in limiting]
        groups = [
            [c.g[i] - c.lbg[i] for i in range(len(c.constraints)) if c.lbg[i] == c.ubg[i]],
            [*sides, *(c.g[i] - c.lbg[i] for rows in limits for i in rows)],
            starts,
            [c.g[i] - c.lbg[i] for i in rest if np.isfinite(c.lbg[i])] + [c.ubg[i] - c.g[i] for i in rest if np.isfinite(c.ubg[i])],
            [S[k] for S in (c.G, c.H) for (name, _), k in self._conditions.items() if name == 'pair'],
        ]
        ends = [0, *np.cumsum([len(group) for group in groups]).tolist()]
        functions = 2 * len(there) + len(limits)
        self.vanishing = np.arange(ends[1])
        self.signed = np.arange(ends[1], ends[2]).reshape(functions, L)
        self.starts = np.array([ends[2] + k if k >= 0 else -1 for k in begins] + [-1] * len(limits), dtype=int)
        self.others, self.cross = slice(ends[3], ends[4]), np.arange(ends[4], ends[5]).reshape(2, -1)
        self.continuous = np.array([s for points in there.values() for s in points.continuous] + [True] * len(limits), dtype=bool)
        self._compile(ca.vertcat(*(entry for group in groups for entry in group)) if ends[-1] else ca.SX(0, 1), ends[3])

    def _compile(self, V, differentiated):
        c, J = self._c, ca.jacobian(V[:differentiated], self._c.x)
        function = ca.Function('element', [c.x, c.p], [V, J])
        self.rows = np.array(J.sparsity().row(), dtype=int)
        self.columns = np.repeat(np.arange(c.x.numel()), np.diff(J.sparsity().colind()))
        self._w, self._p = np.zeros(c.x.numel()), np.zeros(max(1, c.p.numel()))
        self.V, self._J = np.zeros(max(1, V.numel())), np.zeros(max(1, self.rows.size))
        self._buffer, self._evaluate = function.buffer()
        for set_one, number, array in (
            (self._buffer.set_arg, 0, self._w),
            (self._buffer.set_arg, 1, self._p),
            (self._buffer.set_res, 0, self.V),
            (self._buffer.set_res, 1, self._J),
        ):
            set_one(number, memoryview(array))

    def know(self, values):
        """Take the values of what is known."""
        self._p[: len(values)] = values

    def at(self, w):
        """Evaluate at ``w``: V and the entries of its Jacobian at ``rows`` and ``columns``, good until the next call."""
        self._w[:] = w
        self._evaluate()
        return self.V, self._J

    def point(self, values):
        """w of the values of the unknowns; 0 where there is none."""
        found = np.array(values, dtype=float)[self._places]
        return np.where(np.isfinite(found), found, 0.0) * self._c.scale.x

    def values(self, w, before):
        """Values of the unknowns; those that no function contains stay as they are."""
        found = list(before)
        for k, number in zip(self._places.tolist(), (w / self._c.scale.x).tolist()):
            found[k] = number
        return found
