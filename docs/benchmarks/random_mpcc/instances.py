"""Random small MPCCs of eight kinds, each a function of its seed.

    min f(w)   s.t.  lb <= w <= ub,  low <= g(w) <= high,  0 <= G(w) perp H(w) >= 0

Functions are written once, for any kind of number: a Pyomo model for the solver and casadi expressions for the judge come from the
same text.  ``Units`` turn an instance into one in bad units; the judge always works in the good ones.
"""

from dataclasses import dataclass, field, replace
from typing import Callable

import casadi as ca
import numpy as np
import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements

INF = np.inf


@dataclass(frozen=True)
class Units:
    """The solver gets w times ``x``, rows times ``g``, and f times ``f`` plus ``offset``."""

    x: np.ndarray
    g: np.ndarray
    f: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Instance:
    """One MPCC.

    Attributes
    ----------
    functions : callable (w, exp, sin) -> f, list of g, list of (G, H)
    lb, ub, low, high, start : arrays
    ray : array or None
        a direction along which f falls for ever, if one is known
    point : array or None
        a feasible point, if one is known
    """

    kind: str
    seed: int
    functions: Callable
    lb: np.ndarray
    ub: np.ndarray
    low: np.ndarray
    high: np.ndarray
    start: np.ndarray
    units: Units
    point: object = None
    ray: object = None

    def symbolic(self):
        """w, f, g, G, H as casadi SX, in good units."""
        w = ca.SX.sym('w', len(self.lb))
        f, rows, pairs = self.functions([w[j] for j in range(w.numel())], ca.exp, ca.sin)
        return w, ca.SX(f), _column(rows), _column([G for G, _ in pairs]), _column([H for _, H in pairs])

    def model(self):
        """The Pyomo model, in the instance's units."""
        m, u = pyo.ConcreteModel(), self.units
        m.w = pyo.Var(range(len(self.lb)))
        for j, v in m.w.items():
            v.setlb(None if self.lb[j] == -INF else float(self.lb[j] * u.x[j]))
            v.setub(None if self.ub[j] == INF else float(self.ub[j] * u.x[j]))
            v.set_value(float(self.start[j] * u.x[j]))
        good = [v if u.x[j] == 1.0 else v / float(u.x[j]) for j, v in m.w.items()]
        f, rows, pairs = self.functions(good, pyo.exp, pyo.sin)
        m.f = pyo.Objective(expr=float(u.f) * f + float(u.offset))
        m.rows = pyo.ConstraintList()
        for row, low, high, factor in zip(rows, self.low, self.high, u.g):
            m.rows.add((_bound(low * factor), float(factor) * row, _bound(high * factor)))
        sides = [tuple(_plain(side, m.w, u) for side in pair) for pair in pairs]
        m.c = Complementarity(range(len(pairs)), rule=lambda m, k: complements(sides[k][0] >= 0, sides[k][1] >= 0))
        return m

    def values(self, model):
        """The model's values in good units."""
        return np.array([np.nan if v.value is None else v.value for v in model.w.values()]) / self.units.x


def _plain(side, w, units):
    """A side that is a variable in other units is the variable itself: the sign is all that counts."""
    if side.is_variable_type() or not any(u != 1.0 for u in units.x):
        return side
    return next((v for v, u in zip(w.values(), units.x) if side is v), side)


def _bound(number):
    return None if np.isinf(number) else float(number)


def _column(entries):
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)


@dataclass
class Draft:
    """An instance in the making, around an anchor that satisfies it; terms are coefficient arrays."""

    random: object
    n: int
    anchor: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    rows: list = field(default_factory=list)
    pairs: list = field(default_factory=list)
    objective: object = None

    def numbers(self, *shape):
        """Small integers or normal deviates, half of the time each."""
        return self.random.integers(-3, 4, shape).astype(float) if self.random.random() < 0.5 else self.random.normal(size=shape)

    def coefficients(self):
        """Coefficients of two to four variables."""
        a = np.zeros(self.n)
        used = self.random.permutation(self.n)[: self.random.integers(2, min(self.n, 4) + 1)]
        a[used] = self.numbers(len(used))
        a[used[0]] = a[used[0]] or 1.0
        return a


@dataclass(frozen=True)
class Term:
    """a'w + w'Pw/2 + curves + b; ``curves`` are (coefficient, 'exp' or 'sin', variable)."""

    a: np.ndarray
    b: float = 0.0
    P: np.ndarray = None
    curves: tuple = ()

    def __call__(self, w, exp=np.exp, sin=np.sin):
        total = self.b
        for j in np.flatnonzero(self.a):
            total = total + float(self.a[j]) * w[j]
        if self.P is not None:
            for i, j in zip(*np.nonzero(self.P)):
                total = total + float(self.P[i, j]) / 2 * w[i] * w[j]
        for c, kind, j in self.curves:
            total = total + c * (exp if kind == 'exp' else sin)(w[j])
        return total

    def through(self, point, value):
        """The same function, shifted to ``value`` at ``point``."""
        return replace(self, b=self.b + float(value - self(point)))

    def variable(self):
        """The index of the variable that this term is, or None."""
        j = np.flatnonzero(self.a)
        plain = self.P is None and not self.curves and self.b == 0 and len(j) == 1 and self.a[j[0]] == 1
        return int(j[0]) if plain else None


# The kinds.  Each fills a Draft.


def _start(random, q, more):
    n = 2 * q + more
    anchor = np.round(random.normal(size=n), 3)
    return Draft(random, n, anchor, np.full(n, -INF), np.full(n, INF))


def _plain_pairs(d, q, biactive):
    """Variables 2k and 2k+1 are the sides of pair k."""
    for k in range(q):
        both, first = d.random.random() < biactive, int(d.random.integers(2))
        d.anchor[2 * k + first] = 0.0
        d.anchor[2 * k + 1 - first] = 0.0 if both else d.random.uniform(0.2, 2.0)
        d.pairs.append((Term(np.eye(d.n)[2 * k]), Term(np.eye(d.n)[2 * k + 1])))
        d.lb[2 * k : 2 * k + 2] = 0.0


def _rows(d, count, P=None, curves=None):
    for _ in range(count):
        term = Term(d.coefficients(), 0.0, None if P is None else P(), () if curves is None else curves())
        now = term(d.anchor)
        kind, slack = d.random.choice(['<=', '>=', '==']), d.random.choice([0.0, 1.0])
        low = now - slack if kind == '>=' else now if kind == '==' else -INF
        high = now + slack if kind == '<=' else now if kind == '==' else INF
        d.rows.append((term, low, high))


def _box(d, size=5.0):
    d.lb, d.ub = np.maximum(d.lb, d.anchor - size), np.minimum(d.ub, d.anchor + size)
    d.lb[[j for pair in d.pairs for j in (pair[0].variable(), pair[1].variable()) if j is not None]] = 0.0


def _convex(d):
    R = d.numbers(d.n, d.n)
    target = d.anchor + d.random.normal(size=d.n)
    P = R.T @ R / d.n + np.eye(d.n) / 2
    return Term(-P @ target, 0.0, P)


def _bilinear_matrix(d):
    P = np.zeros((d.n, d.n))
    i, j = d.random.permutation(d.n)[:2]
    P[i, j] = P[j, i] = d.random.choice([-1.0, 1.0])
    return P


def bilinear(random):
    """Products of two variables in rows, sides and the objective."""
    d = _start(random, int(random.integers(1, 4)), int(random.integers(1, 4)))
    _plain_pairs(d, len(d.anchor) // 2 if d.n <= 3 else int(random.integers(1, d.n // 2)), 0.2)
    _rows(d, int(random.integers(1, 4)), P=lambda: _bilinear_matrix(d))
    if random.random() < 0.5:
        side = Term(d.coefficients(), 0.0, _bilinear_matrix(d)).through(d.anchor, 0.0)
        d.pairs.append((side, Term(d.coefficients()).through(d.anchor, random.choice([0.0, 1.0]))))
    _box(d)
    f = _convex(d)
    d.objective = replace(f, P=f.P + _bilinear_matrix(d))
    return d


def degenerate(random):
    """Many pairs with both sides zero at a point that is stationary for some signs of the multipliers."""
    q = int(random.integers(3, 8))
    d = _start(random, q, int(random.integers(0, 3)))
    _plain_pairs(d, q, 0.8)
    _rows(d, int(random.integers(0, 3)))
    f = _convex(d) if random.random() < 0.7 else Term(np.zeros(d.n))
    a = f.a - (np.zeros(d.n) if f.P is None else f.P @ d.anchor) - f.a
    for G, H in d.pairs:
        for side in (G, H):
            if abs(side(d.anchor)) < 1e-9:
                a = a + side.a * random.choice([0.0, 1.0, 2.0, -1.0], p=[0.3, 0.4, 0.2, 0.1])
    d.objective = replace(f, a=a)
    _box(d)
    return d


def redundant(random):
    """Rows and pairs that repeat or follow from one another; sides that several pairs share."""
    q = int(random.integers(2, 4))
    d = _start(random, q, 2)
    _plain_pairs(d, q, 0.3)
    _rows(d, 2)
    for _ in range(int(random.integers(1, 4))):
        (one, low, high), (two, low2, high2) = d.rows[0], d.rows[int(random.integers(len(d.rows)))]
        factor = random.choice([-2.0, 0.5, 3.0])
        both = Term(one.a + factor * two.a, one.b + factor * two.b)
        sides = sorted((factor * low2, factor * high2))
        if np.isfinite([low + sides[0], high + sides[1]]).any():
            d.rows.append((both, low + sides[0], high + sides[1]))
    G, H = d.pairs[int(random.integers(q))]
    how = random.choice(['copy', 'mirror', 'multiple', 'shared'])
    if how == 'shared':
        d.pairs.append((G, Term(d.coefficients()).through(d.anchor, 0.0 if G(d.anchor) > 0 else random.choice([0.0, 1.0]))))
    else:
        d.pairs.append({'copy': (G, H), 'mirror': (H, G), 'multiple': (Term(2 * G.a, 2 * G.b), H)}[how])
    d.objective = _convex(d)
    return d


def bilevel(random):
    """min over x of |x - x0|^2 + |y - y0|^2 where y minimises a strictly convex QP with x in it: its KKT conditions as pairs."""
    nx, ny, m = (int(random.integers(1, k)) for k in (3, 4, 5))
    d = _start(random, 0, nx + ny + m)
    x, y, lam = np.arange(nx), nx + np.arange(ny), nx + ny + np.arange(m)
    R, A, B, C = d.numbers(ny, ny), d.numbers(m, ny), d.numbers(m, nx), d.numbers(ny, nx)
    Q = R.T @ R + np.eye(ny)
    A[:, 0] = np.where(A.any(axis=1), A[:, 0], 1.0)
    active = random.random(m) < 0.6
    d.anchor[lam] = np.where(active & (random.random(m) < 0.7), random.uniform(0.2, 2, m), 0.0)
    slack = np.where(active, 0.0, random.uniform(0.2, 2, m))
    b = slack + A @ d.anchor[y] - B @ d.anchor[x]
    c = -(Q @ d.anchor[y] + C @ d.anchor[x] + A.T @ d.anchor[lam])
    for k in range(ny):
        a = np.zeros(d.n)
        a[x], a[y], a[lam] = C[k], Q[k], A[:, k]
        d.rows.append((Term(a), -c[k], -c[k]))
    for i in range(m):
        a = np.zeros(d.n)
        a[x], a[y] = B[i], -A[i]
        d.pairs.append((Term(np.eye(d.n)[lam[i]]), Term(a, b[i])))
        d.lb[lam[i]] = 0.0
    d.lb[x], d.ub[x] = d.anchor[x] - 3, d.anchor[x] + 3
    weight = np.zeros(d.n)
    weight[np.concatenate([x, y])] = 1.0
    target = d.anchor + random.normal(size=d.n)
    d.objective = Term(-weight * target, 0.0, np.diag(weight))
    return d


def _curves(d):
    return tuple(
        (float(d.random.choice([-0.5, 0.5])), str(d.random.choice(['exp', 'sin'])), int(d.random.integers(d.n))) for _ in range(2)
    )


def nonlinear(random):
    """Exponentials and sines in rows, sides and the objective."""
    q = int(random.integers(1, 4))
    d = _start(random, q, int(random.integers(1, 3)))
    _plain_pairs(d, q, 0.2)
    side = Term(d.coefficients(), 0.0, None, _curves(d)).through(d.anchor, 0.0)
    other = Term(d.coefficients()).through(d.anchor, random.choice([0.0, 1.0]))
    d.pairs.append((side, other))
    _rows(d, int(random.integers(1, 3)), curves=lambda: _curves(d))
    _box(d, 3.0)
    d.objective = replace(_convex(d), curves=_curves(d))
    return d


def unbounded(random):
    """Falls for ever along a side of one pair or along a free variable; other branches may have local minima."""
    q = int(random.integers(1, 4))
    d = _start(random, q, 2)
    _plain_pairs(d, q, 0.2)
    fixed = np.zeros(d.n, dtype=bool)
    j = int(random.integers(2)) if random.random() < 0.5 else d.n - 1
    d.anchor[j] = max(d.anchor[j], 0.0) if j < 2 else d.anchor[j]
    if j < 2:
        d.anchor[1 - j] = 0.0
    _rows(d, int(random.integers(0, 3)))
    fixed[j] = True
    # the ray is no part of any row, and enters the objective linearly
    for term, _, _ in d.rows:
        term.a[j] = 0.0
    d.rows = [(term, low - 1.0, high + 1.0) for term, low, high in d.rows if term.a.any()]
    d.rows = [(t, min(low, t(d.anchor)), max(high, t(d.anchor))) for t, low, high in d.rows]
    f = _convex(d)
    P = f.P.copy()
    P[j, :] = P[:, j] = 0.0
    a = f.a.copy()
    a[j] = -random.uniform(0.5, 2.0)
    d.objective = Term(a, 0.0, P)
    d.ray = np.eye(d.n)[j]
    return d


def infeasible(random):
    """No branch has a point: both sides of a pair are kept positive, by rows or by a function of both."""
    q = int(random.integers(1, 5))
    d = _start(random, q, int(random.integers(1, 3)))
    _plain_pairs(d, q, 0.2)
    _rows(d, int(random.integers(0, 3)))
    G, H = d.pairs[0]
    how = random.choice(['both', 'product', 'sum'])
    if how == 'both':
        d.rows += [(G, 0.5, INF), (H, 0.5, INF)]
    elif how == 'product':
        P = np.zeros((d.n, d.n))
        P[0, 1] = P[1, 0] = 1.0
        d.rows.append((Term(np.zeros(d.n), 0.0, P), 0.5, INF))
    else:
        # x + y >= 3, and each of them at most 1
        d.ub[:2] = 1.0
        d.rows.append((Term(G.a + H.a), 1.5, INF))
    d.objective = _convex(d)
    if how == 'product' or random.random() < 0.5:
        # without bounds a product is only just missed, where one factor goes to 0 and the other one to infinity
        _box(d)
    return d


KINDS = {
    'bilinear': bilinear,
    'degenerate': degenerate,
    'redundant': redundant,
    'bilevel': bilevel,
    'nonlinear': nonlinear,
    'badly scaled': None,
    'unbounded': unbounded,
    'infeasible': infeasible,
}
#: Kinds that are put into bad units.
SCALED = (bilinear, degenerate, redundant, bilevel, nonlinear)


def generate(seed: int) -> Instance:
    """The instance of this seed; the kinds take turns."""
    random, kind = np.random.default_rng([seed, 13]), [*KINDS][seed % len(KINDS)]
    fill = KINDS[kind] or SCALED[random.integers(len(SCALED))]
    d = fill(random)
    n, m = d.n, len(d.rows)
    units = Units(np.ones(n), np.ones(m))
    if kind == 'badly scaled':
        one = 10.0 ** random.uniform(-8, 8) if random.random() < 0.5 else 10.0 ** random.uniform(-3, 3, n)
        units = Units(np.full(n, 1.0) * one, 10.0 ** random.uniform(-6, 6, m), 10.0 ** random.uniform(-10, 10))
        units = replace(units, offset=units.f * random.choice([0.0, 1e4, -1e8]))
    rows, pairs, objective = d.rows, d.pairs, d.objective

    def functions(w, exp, sin):
        return (
            objective(w, exp, sin),
            [t(w, exp, sin) for t, _, _ in rows],
            [(_side(G, w, exp, sin), _side(H, w, exp, sin)) for G, H in pairs],
        )

    start = {'zero': np.zeros(n), 'anchor': d.anchor, 'random': random.normal(size=n) * 3}[
        str(random.choice(['zero', 'anchor', 'random']))
    ]
    return Instance(
        kind,
        seed,
        functions,
        d.lb,
        d.ub,
        np.array([low for _, low, _ in rows]),
        np.array([high for *_, high in rows]),
        np.clip(start, d.lb, d.ub),
        units,
        None if kind == 'infeasible' else d.anchor,
        getattr(d, 'ray', None),
    )


def _side(term, w, exp, sin):
    """A side that is a plain variable stays one."""
    j = term.variable()
    return term(w, exp, sin) if j is None else w[j]
