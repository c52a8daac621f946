"""One kind of element as compiled functions: what must vanish, and what must not become negative.

    equations = 0;      sides G, H of every condition and limits, at every label;      signs of all else that is generated

All are in the solver's scaling, with exact sparse derivatives; the graph is that of ``mpcc.compile``.

Takes: ``Equations``.
Leaves: nothing.
Does not apply: where a condition is there at some labels of an element only (``complete`` is False).
"""

import casadi as ca
import numpy as np


from pyomo_fesd.march.equations import variables_of
from pyomo_fesd.march.scene import Scene
from pyomo_fesd.mpcc.compile import compile_problem
from pyomo_fesd.mpcc.problem import read_problem


class Functions:
    """Compiled functions of w (unknowns) and p (known values).

    ``function k`` is row k of ``signed``: side G of condition i for k = 2 i, H for k = 2 i + 1, then the limits.

    Attributes
    ----------
    names : list of str
        conditions
    signed : int array (functions, labels)
        where their values stand in V
    vanishing : int array
        where the residuals of equations stand
    others, cross : slice, int array (2, pairs)
        where further signs, and both sides of the aggregated pairs stand
    differentiated : int
        so many first entries of V have derivatives
    rows, columns : int arrays
        where the derivatives stand in the Jacobian
    repeated : bool array (functions)
        sides whose value at the right boundary is that at the last stage
    lower, upper : arrays
        bounds of w
    length : int
        place of the length multiplier
    """

    def __init__(self, pattern, timer, user_scaling=True):
        scene = Scene(pattern)
        self.names, L = list(pattern.points), len(pattern.labels)
        points = [pair for pairs in pattern.points.values() for pair in pairs]
        scene.add_pairs('point', points)
        scene.add_pairs('pair', pattern.pairs)
        c = compile_problem(
            read_problem(scene.model), timer, parameters=list(scene.model.known.values()), user_scaling=user_scaling
        )
        self._places = np.array([v.index() for v in c.variables], dtype=int)
        self._unknowns, self._scale = len(pattern.unknown), c.scale.x
        self.length = next(j for j, v in enumerate(c.variables) if v is scene.length)
        self.lower, self.upper = c.lbx.copy(), c.ubx.copy()
        self.lower[self.length], self.upper[self.length] = -np.inf, np.inf
        self.complete = c.scale.x[self.length] == 1.0 and self._assemble(c, scene, pattern, L)

    def _assemble(self, c, scene, pattern, L):
        """Collect V; returns whether everything is there at every label."""
        where = {(d.source.parent_component().local_name, d.source.index()): k for k, d in enumerate(c.conditions)}
        if any(len(pairs) != L for pairs in pattern.points.values()):
            return False
        at = {id(row): i for i, row in enumerate(c.constraints)}
        # a condition that says the same as another is not there twice
        self.names = [n for i, n in enumerate(self.names) if all(('point', i * L + k) in where for k in range(L))]
        kept = [i for i, n in enumerate(pattern.points) if n in self.names]
        sides = [S[where['point', i * L + k]] for i in kept for S in (c.G, c.H) for k in range(L)]
        limits = [rows for rows in scene.rows.values() if all(id(row) in at for row in rows)]
        used = {at[id(row)] for rows in limits for row in rows}
        equal = [i for i in range(len(c.constraints)) if c.lbg[i] == c.ubg[i]]
        lower = [i for i in range(len(c.constraints)) if i not in used and c.lbg[i] < c.ubg[i] and np.isfinite(c.lbg[i])]
        upper = [i for i in range(len(c.constraints)) if i not in used and c.lbg[i] < c.ubg[i] and np.isfinite(c.ubg[i])]
        pairs = [k for (name, _), k in where.items() if name == 'pair']
        groups = [
            [c.g[i] - c.lbg[i] for i in equal],
            [*sides, *(c.g[at[id(row)]] - c.lbg[at[id(row)]] for rows in limits for row in rows)],
            [*(c.g[i] - c.lbg[i] for i in lower), *(c.ubg[i] - c.g[i] for i in upper)],
            [S[k] for S in (c.G, c.H) for k in pairs],
        ]
        ends = np.cumsum([0, *map(len, groups)])
        self.vanishing = np.arange(ends[1])
        self.signed = np.arange(ends[1], ends[2]).reshape(2 * len(kept) + len(limits), L)
        self.others, self.cross = slice(ends[2], ends[3]), np.arange(ends[3], ends[4]).reshape(2, len(pairs))
        self.differentiated = int(ends[2])
        self.repeated = self._repeated(pattern, kept, len(limits))
        self._compile(c, ca.vertcat(*(entry for group in groups for entry in group)) if ends[-1] else ca.SX(0, 1))
        return True

    def _repeated(self, pattern, kept, limits):
        names = list(pattern.points)
        sides = [side for i in kept for side in pattern.points[names[i]][-1]]
        return np.array([_is_held(side, pattern.held) for side in sides] + [False] * limits, dtype=bool)

    def _compile(self, c, V):
        J = ca.jacobian(V[: self.differentiated], c.x)
        function = ca.Function('element', [c.x, c.p], [V, J])
        colind, row = np.array(J.sparsity().colind()), np.array(J.sparsity().row(), dtype=int)
        self.rows, self.columns = row, np.repeat(np.arange(c.x.numel()), np.diff(colind))
        self._w, self._p = np.zeros(c.x.numel()), np.zeros(max(1, c.p.numel()))
        self.V, self.J = np.zeros(V.numel()), np.zeros(max(1, row.size))
        self._buffer, self._evaluate = function.buffer()
        self._buffer.set_arg(0, memoryview(self._w))
        self._buffer.set_arg(1, memoryview(self._p))
        self._buffer.set_res(0, memoryview(self.V))
        self._buffer.set_res(1, memoryview(self.J))

    def know(self, values):
        """Take the values of what is known."""
        self._p[: len(values)] = values

    def at(self, w):
        """Evaluate at ``w``: ``V`` and ``J``, good until the next call."""
        self._w[:] = w
        self._evaluate()
        return self.V, self.J

    def point(self, values):
        """w of the values of the unknowns; 0 where there is none."""
        found = np.array(values, dtype=float)[self._places]
        return np.where(np.isfinite(found), found, 0.0) * self._scale

    def values(self, w, before):
        """Values of the unknowns; those that no function contains stay as they are."""
        found = list(before)
        for k, number in zip(self._places.tolist(), (w / self._scale).tolist()):
            found[k] = number
        return found


def _is_held(side, held):
    """Whether a side at the right boundary is, or contains nothing but, what repeats the last stage."""
    return id(side) in held or any(id(v) in held for v in variables_of([side]))
