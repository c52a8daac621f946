"""Random small MPCCs as plain data, and as Pyomo models.

An instance is quadratic functions, bounds, rows and conditions; ``branch_check`` judges it, ``fuzz`` puts it to the solver.
"""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements

INF = np.inf


@dataclass(frozen=True)
class Quadratic:
    """w'Pw/2 + a'w + b; linear where P is None."""

    a: np.ndarray
    b: float = 0.0
    P: np.ndarray = None

    def __call__(self, w):
        return float(self.a @ w + self.b + (0 if self.P is None else w @ self.P @ w / 2))

    def gradient(self, w):
        return self.a if self.P is None else self.a + self.P @ w


@dataclass
class Instance:
    """min or max f over lb <= w <= ub with rows ``(function, low, high)`` and conditions.

    A condition is ``('pair', G, H)`` or ``('mixed', low, high, B, F)``.  ``known`` is a feasible point, if the generator knows one.
    """

    seed: int
    f: Quadratic = None
    maximise: bool = False
    lb: np.ndarray = None
    ub: np.ndarray = None
    rows: list = field(default_factory=list)
    conditions: list = field(default_factory=list)
    fixed: list = field(default_factory=list)
    start: list = None
    zeros: bool = False
    known: np.ndarray = None
    marks: list = field(default_factory=list)

    @property
    def convex(self):
        """Whether each branch is an LP or a convex QP."""
        flat = all(row.P is None for row, _, _ in self.rows)
        return flat and (self.f is None or self.f.P is None or np.linalg.eigvalsh(self.f.P).min() > -1e-9)

    @property
    def idle(self):
        """Mask of the variables that stand nowhere: a solver leaves them as they are."""
        functions = [self.f] * (self.f is not None) + [r[0] for r in self.rows]
        functions += [part for c in self.conditions for part in c if isinstance(part, Quadratic)]
        used = [(g.a != 0) if g.P is None else (g.a != 0) | g.P.any(axis=0) for g in functions]
        return ~np.any(used, axis=0)

    def alternatives(self, condition):
        """The ways in which a condition can hold, each a list of rows."""
        if condition[0] == 'pair':
            _, G, H = condition
            return [[(G, 0, 0), (H, 0, INF)], [(H, 0, 0), (G, 0, INF)]]
        _, low, high, B, F = condition
        return [[(B, low, low), (F, 0, INF)], [(B, high, high), (F, -INF, 0)], [(B, low, high), (F, 0, 0)]]


class _Generator:
    """Draws one instance around an anchor that satisfies it, unless it is to be infeasible or left to chance."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.out = Instance(seed)

    def chance(self, p):
        return self.random.random() < p

    def pick(self, *choices, p=None):
        return choices[self.random.choice(len(choices), p=p)]

    def numbers(self, *shape):
        """Small integers, where rows and sides often coincide, or normal deviates."""
        return self.random.integers(-3, 4, shape).astype(float) if self.grid else self.random.normal(size=shape)

    def positive(self):
        return float(self.random.integers(1, 4)) if self.grid else self.random.uniform(0.1, 3)

    def draw(self):
        self.grid = self.chance(0.5)
        self.flavour = self.pick('plain', 'degenerate', 'infeasible', 'unbounded', p=[0.5, 0.25, 0.12, 0.13])
        self.n, self.q = int(self.random.integers(2, 7)), int(self.random.integers(1, 5))
        self.anchor = self.numbers(self.n) * (50 if self.chance(0.05) else 1)
        self.free = list(self.random.permutation(self.n))
        self.anchored = self.flavour != 'plain' or self.chance(0.7)
        out = self.out
        out.marks = [self.flavour] + ['grid'] * self.grid + ['by chance'] * (not self.anchored)
        out.lb, out.ub = np.full(self.n, -INF), np.full(self.n, INF)
        while len(out.conditions) < self.q:
            self.condition()
        self.rows()
        self.bounds()
        self.objective()
        self.spoil()
        if self.anchored and self.flavour != 'infeasible':
            out.known = self.anchor
        out.start, out.zeros = self.start(), self.chance(0.05)
        return out

    def side(self, target):
        """A function with the value ``target`` at the anchor: a plain variable where one is free, or a linear expression."""
        a = np.zeros(self.n)
        if self.free and self.chance(0.6):
            j = self.free.pop()
            a[j] = 1.0
            if self.chance(0.8):
                self.anchor[j] = target
                return Quadratic(a)
            return Quadratic(a, target - self.anchor[j])
        used = self.random.permutation(self.n)[: self.random.integers(1, self.n + 1)]
        a[used] = self.numbers(len(used))
        a[used[0]] = a[used[0]] or 1.0
        # the anchor may still move where a later side is a plain variable: close the list of free ones
        self.free = []
        return Quadratic(a, target - a @ self.anchor if self.anchored else float(self.numbers()))

    def condition(self):
        out = self.out
        both = self.chance(0.6 if self.flavour == 'degenerate' else 0.15)
        pairs = [c for c in out.conditions if c[0] == 'pair']
        if pairs and self.chance(0.2):
            _, G, H = pairs[self.random.integers(len(pairs))]
            how = self.pick('copy', 'mirror', 'shared')
            out.marks.append(how)
            if how == 'shared':
                new = ('pair', G, self.side(0.0 if both or G(self.anchor) > 0 else self.positive()))
            else:
                new = ('pair', G, H) if how == 'copy' else ('pair', H, G)
        elif self.chance(0.15):
            out.marks.append('mixed')
            width = 0.0 if self.chance(0.1) else self.positive()
            place = self.pick(0.0, 0.5, 1.0)
            F = self.side(0.0 if both or place == 0.5 else self.positive() * (1 - 2 * place))
            B = self.side(place * width)
            low = 0.0 if not self.anchored else float(np.round(B(self.anchor) - place * width, 12))
            new = ('mixed', low, low + width, B, F)
        else:
            values = (0.0, 0.0 if both else self.positive())
            first = int(self.random.integers(2))
            new = ('pair', self.side(values[first]), self.side(values[1 - first]))
        out.conditions.append(new)

    def rows(self):
        out = self.out
        for _ in range(self.random.integers(0, 4)):
            if out.rows and self.flavour == 'degenerate' and self.chance(0.4):
                row, low, high = out.rows[-1]
                out.marks.append('dependent')
                if row.P is None:
                    out.rows.append((Quadratic(2 * row.a, 2 * row.b), 2 * low, 2 * high))
                continue
            a, P = self.numbers(self.n), None
            a[0] = a[0] if a.any() else 1.0
            if self.chance(0.12):
                out.marks.append('nonlinear')
                P = np.diag(np.abs(self.numbers(self.n))) if self.chance(0.5) else self.symmetric()
            row = Quadratic(a, 0.0, P)
            now = row(self.anchor) if self.anchored else float(self.numbers())
            slack = 0.0 if self.chance(0.4) else self.positive()
            kind = self.pick('<=', '>=', '==', 'ranged', p=[0.35, 0.35, 0.15, 0.15])
            low = now if kind == '==' else now - slack if kind in ('>=', 'ranged') else -INF
            high = now if kind == '==' else now + slack if kind == '<=' else now + self.positive() if kind == 'ranged' else INF
            out.rows.append((row, low, high))

    def symmetric(self):
        P = self.numbers(self.n, self.n)
        return P + P.T

    def bounds(self):
        out, boxed = self.out, self.chance(0.5)
        for j in range(self.n):
            now = self.anchor[j]
            if self.chance(0.1):
                out.lb[j] = out.ub[j] = now
                out.fixed.append(j)
                continue
            if boxed or self.chance(0.5):
                out.lb[j] = now - self.pick(0.0, self.positive()) if self.chance(0.4) else min(0.0, now)
            if self.flavour != 'unbounded' and (boxed or self.chance(0.3)):
                out.ub[j] = now + self.positive() * 3

    def objective(self):
        out = self.out
        if self.chance(0.06):
            return
        shape = 'linear' if self.flavour == 'unbounded' else self.pick('linear', 'convex', 'flat', 'indefinite')
        P = None
        if shape == 'convex':
            R = self.numbers(self.n, self.n)
            P = R.T @ R + np.eye(self.n) / 2
        elif shape == 'flat':
            # convex, and flat in some directions: only within a box, where HiGHS' answer is beyond doubt
            R = self.numbers(max(1, self.n // 2), self.n)
            P = R.T @ R
            out.lb, out.ub = np.maximum(out.lb, self.anchor - 10), np.minimum(out.ub, self.anchor + 10)
        elif shape == 'indefinite':
            P = self.symmetric()
        a = self.numbers(self.n)
        if self.flavour == 'degenerate':
            # the anchor is stationary for multipliers of the bi-active sides: of either sign now and then, a trap
            a = np.zeros(self.n) if P is None else -P @ self.anchor
            for condition in out.conditions:
                for side in condition[1:] if condition[0] == 'pair' else ():
                    if abs(side(self.anchor)) < 1e-9:
                        a = a + side.gradient(self.anchor) * self.pick(0.0, 1.0, 2.0, -1.0, p=[0.3, 0.4, 0.2, 0.1])
        scale = 10 ** self.random.uniform(-2, 3) if self.chance(0.1) else 1.0
        out.f = Quadratic(scale * a, 0.0, None if P is None else scale * P)
        out.maximise = self.chance(0.15)
        out.marks.append(shape)

    def spoil(self):
        """Both sides of one pair positive."""
        pairs = [c for c in self.out.conditions if c[0] == 'pair']
        if self.flavour == 'infeasible' and pairs:
            _, G, H = pairs[0]
            self.out.rows += [(G, 0.5, INF), (H, 0.5, INF)]

    def start(self):
        how = self.pick('none', 'zero', 'anchor', 'random', 'some')
        if how == 'none':
            return [None] * self.n
        values = {'zero': np.zeros(self.n), 'anchor': self.anchor}.get(how, self.random.normal(size=self.n) * 3)
        return [None if how == 'some' and self.chance(0.5) else float(v) for v in values]


def generate(seed):
    """The instance of this seed."""
    return _Generator(seed).draw()


def as_model(p):
    """``p`` in Pyomo; a function that stands in several places is one named Expression there."""
    m = pyo.ConcreteModel()
    m.w = pyo.Var(range(len(p.lb)))
    for j, v in m.w.items():
        v.set_value(p.start[j], skip_validation=True)
        if j in p.fixed:
            v.fix(p.lb[j])
        else:
            v.setlb(None if p.lb[j] == -INF else p.lb[j])
            v.setub(None if p.ub[j] == INF else p.ub[j])
    uses = Counter(id(side) for c in p.conditions for side in c if isinstance(side, Quadratic))
    m.e = pyo.Expression(pyo.Any)
    shared = {}

    def side(function):
        expr = expression(m, function, p.zeros)
        if uses[id(function)] > 1 and not expr.is_variable_type():
            if id(function) not in shared:
                m.e[len(shared)] = expr
                shared[id(function)] = m.e[len(shared)]
            return shared[id(function)]
        return expr

    def relation(m, k):
        kind, *rest = p.conditions[k]
        if kind == 'pair':
            return complements(side(rest[0]) >= 0, side(rest[1]) >= 0)
        low, high, B, F = rest
        return complements(pyo.inequality(low, side(B), high), side(F))

    m.c = Complementarity(range(len(p.conditions)), rule=relation)
    m.rows = pyo.ConstraintList()
    for row, low, high in p.rows:
        m.rows.add((None if low == -INF else low, expression(m, row), None if high == INF else high))
    if p.f is not None:
        sign = -1 if p.maximise else 1
        m.f = pyo.Objective(expr=sign * expression(m, p.f), sense=pyo.maximize if p.maximise else pyo.minimize)
    return m


def expression(m, function, zeros=False):
    """A Quadratic over ``m.w``; a plain variable stays one; ``zeros`` keeps the terms that are zero, as a matrix product would."""
    used = np.flatnonzero(function.a)
    if function.P is None and function.b == 0 and len(used) == 1 and function.a[used[0]] == 1:
        return m.w[used[0]]
    linear = sum(float(function.a[j]) * m.w[j] for j in (m.w if zeros else used)) + function.b
    if function.P is None:
        return linear
    P = function.P
    return linear + sum(float(P[i, j]) / 2 * m.w[i] * m.w[j] for i in m.w for j in m.w if P[i, j])
