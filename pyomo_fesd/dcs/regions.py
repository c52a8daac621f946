"""Regions: switching functions and the sign matrix S, read off the inequalities of the disjuncts (theory, eq. 4).

Two inequalities speak of the same switching function when they are proportional, however they are written (``x <= 1``,
``2 - 2*x >= 0``, ``1 >= x``).  That is decided by their values at a few random points, so any arrangement of any smooth
expression is recognised; the same values reveal affine dependence (``x`` and ``x - 1``), by which sign patterns that no point
can have are told from true gaps.
"""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import value
from pyomo.core.expr.visitor import identify_variables
from scipy.linalg import null_space
from scipy.optimize import linprog

from pyomo_fesd.dcs.cubes import sign_cubes
from pyomo_fesd.errors import FesdError

#: Relative agreement of two functions' values at random points to count as proportional.
PROPORTIONAL = 1e-11
#: Signs that occur together with less than this between the point and the nearest surface occur only where surfaces meet.
SMALLEST_MARGIN = 1e-9
#: More switching functions than this in one Disjunction have too many sign patterns to enumerate.
MOST_FUNCTIONS = 12


@dataclass(frozen=True)
class Geometry:
    """Which signs the modes of a Disjunction ask for, and which signs can occur: the same at all times.

    Attributes
    ----------
    signs : list of tuples
        the sign matrix S as stated, one row a mode: +1, -1, and 0 where the mode says nothing of c_k
    patterns : list of lists of tuples
        for each mode the full sign patterns (+1, -1) of its region; one pattern unless the mode leaves signs open
    touchable : list of tuples
        the full sign patterns that some point has if c_k = 0 counts as either sign
    """

    signs: list
    patterns: list
    touchable: list

    @cached_property
    def cubes(self):
        """S with as many zeros as possible (``sign_cubes``), None where that is not exact at every point."""
        return sign_cubes(self.signs, self.touchable)


@dataclass(frozen=True)
class Regions:
    """The partition of the state space that the modes of one Disjunction make.

    Attributes
    ----------
    functions : list of expressions
        the switching functions c_k, in the order in which they were met; c_1 >= 0 is the first mode's first condition
    geometry : Geometry
    """

    functions: list
    geometry: Geometry


def conditions(inequality):
    """The expressions ``c`` with ``c >= 0`` that an inequality constraint states (two for a ranged one)."""
    body, found = inequality.body, []
    if inequality.lower is not None:
        found.append(body if _is_zero(inequality.lower) else body - inequality.lower)
    if inequality.upper is not None:
        found.append(-body if _is_zero(inequality.upper) else inequality.upper - body)
    return found


def _is_zero(bound):
    """Whether a bound is the constant 0; a mutable Param that is 0 now may be moved."""
    return bound.__class__ in native_numeric_types and bound == 0


def read_regions(disjunction, disjuncts, inequalities, cache):
    """Switching functions and sign patterns of the modes of ``disjunction``.

    Parameters
    ----------
    inequalities : list of lists of ConstraintData
        the inequalities of each disjunct
    cache : dict
        geometries found before, by sign matrix; the same Disjunction at another time has the same one

    Raises
    ------
    FesdError
        for a disjunct without a condition, and for regions that overlap or leave a gap
    """
    stated = [[c for con in cons for c in conditions(con)] for cons in inequalities]
    for disjunct, cs in zip(disjuncts, stated):
        if not cs:
            raise FesdError(
                disjunct,
                f"this mode of Disjunction '{disjunction.name}' has no region condition",
                "add the inequality on the states that holds where the mode is active",
            )
    functions, values, S = _sign_matrix(disjunction, disjuncts, stated)
    relations = _relations(values)
    key = (S.shape, S.tobytes(), (relations.T @ relations).round(6).tobytes())
    if key not in cache:
        cache[key] = _geometry(disjunction, disjuncts, functions, relations, S)
    return Regions(functions, cache[key])


def _sign_matrix(disjunction, disjuncts, stated):
    """Collect the distinct switching functions; S[i, k] = +-1 where mode i needs that sign of c_k, 0 where it does not say."""
    sampled = _sample(disjunction, [c for cs in stated for c in cs])
    functions, values, rows = [], [], []
    for disjunct, cs in zip(disjuncts, stated):
        row = {}
        for c in cs:
            k, sign = _find_or_add(next(sampled), values)
            if k == len(functions):
                functions.append(c)
            if row.setdefault(k, sign) != sign:
                raise FesdError(
                    disjunct,
                    f"the region is empty: it asks for both signs of '{functions[k]}'",
                    "correct the inequalities of this disjunct",
                )
        rows.append(row)
    S = np.zeros((len(rows), len(functions)), dtype=int)
    for i, row in enumerate(rows):
        for k, sign in row.items():
            S[i, k] = sign
    return functions, np.array(values), S


def _find_or_add(F, values):
    """Index of the function that ``F`` is a multiple of, and the sign of the factor; judged by how the values vary.

    A new function is added to ``values``.
    """
    variation = F - F.mean()
    for k, known in enumerate(values):
        other = known - known.mean()
        factor = (variation @ other) / (other @ other) if other.any() else 0
        if factor and np.abs(F - factor * known).max() <= PROPORTIONAL * np.abs(variation).max() + 1e-14 * np.abs(F).max():
            return k, int(np.sign(factor))
    values.append(F)
    return len(values) - 1, 1


def _sample(disjunction, expressions):
    """Yield the values of each expression at the same random points; the variables keep their values."""
    variables = {id(v): v for e in expressions for v in identify_variables(e, include_fixed=True)}.values()
    count = len(expressions) + 3
    kept = [(v, v.value, v.stale) for v in variables]
    table = np.empty((count, len(expressions)))
    random, row, tries = np.random.default_rng(1), 0, 0
    try:
        while row < count:
            for v, old, _ in kept:
                v.set_value((old or 1.0) * random.uniform(0.5, 1.5), skip_validation=True)
            sample = [value_now(e) for e in expressions]
            tries += 1
            if None not in sample:
                table[row] = sample
                row += 1
            elif tries > 20 * count:
                raise FesdError(
                    disjunction,
                    f"the region condition '{expressions[0]} >= 0' cannot be evaluated near the initial values of its variables",
                    "initialise the variables inside the domain of the expression",
                )
    finally:
        for v, old, stale in kept:
            v.set_value(old, skip_validation=True)
            v.stale = stale
    yield from table.T


def compatibility(where, regions, cache):
    """A test whether modes of several Disjunctions can be on at one point: ``{position: mode number}`` -> bool.

    Parameters
    ----------
    where : component that asks, for messages
    regions : list of Regions
        None where a Disjunction has one mode only; nothing is known of it then
    cache : dict
        what was found before
    """
    placed = [k for k, r in enumerate(regions) if r is not None]
    functions = [c for k in placed for c in regions[k].functions]
    values = []
    places = [_find_or_add(F, values) for F in _sample(where, functions)]
    relations = _relations(values)

    def possible(chosen):
        stated = itertools.chain(*(_row(regions[k], chosen.get(k)) for k in placed))
        signs = [0] * len(values)
        for (k, factor), sign in zip(places, stated):
            if sign * factor * signs[k] < 0:
                return False
            signs[k] = sign * factor or signs[k]
        key = (tuple(signs), relations.round(6).tobytes())
        if key not in cache:
            cache[key] = _margin(relations, signs) > SMALLEST_MARGIN
        return cache[key]

    return possible


def _row(regions, mode):
    """The signs that a mode asks for; none if it is not said which mode."""
    return [0] * len(regions.functions) if mode is None else regions.geometry.signs[mode]


def value_now(expression):
    """Value of an expression at the present values, None where it has none."""
    try:
        now = value(expression, exception=False)
    except (ArithmeticError, ValueError):
        return None
    return now if now is not None and np.isreal(now) and np.isfinite(now) else None


def _geometry(disjunction, disjuncts, functions, relations, S):
    """The geometry of the modes; each full sign pattern that some point can have must belong to exactly one of them."""
    if len(functions) > MOST_FUNCTIONS:
        raise FesdError(
            disjunction,
            f"{len(functions)} different switching functions give too many sign patterns",
            "split the Disjunction into independent ones, one for each equipment item that switches",
        )
    owned, touchable = [[] for _ in disjuncts], []
    for pattern in itertools.product((1, -1), repeat=len(functions)):
        margin = _margin(relations, pattern)
        if margin >= -SMALLEST_MARGIN:
            touchable.append(pattern)
        if margin <= SMALLEST_MARGIN:
            continue
        owners = [i for i, row in enumerate(S) if all(s in (0, p) for s, p in zip(row, pattern))]
        if len(owners) == 1:
            owned[owners[0]].append(pattern)
        else:
            where = ' and '.join(f"{c} {'>=' if p > 0 else '<='} 0" for c, p in zip(functions, pattern))
            names = ', '.join(disjuncts[i].name for i in owners) or 'no disjunct'
            raise FesdError(
                disjunction,
                f"the regions {'overlap' if owners else 'leave a gap'}: where {where}, {names} "
                f"{'are active at once' if owners else 'is active'}",
                "make the inequalities of the disjuncts a partition of the state space"
                + ("; for hysteresis, where the last mode decides, name it in the keyword memory of fesd.dcs" if owners else ""),
            )
    for disjunct, patterns in zip(disjuncts, owned):
        if not patterns:
            raise FesdError(
                disjunct, "the region is empty: no point satisfies its inequalities", "correct the inequalities of this disjunct"
            )
    return Geometry([tuple(map(int, row)) for row in S], owned, touchable)


def _relations(values):
    """Rows ``(a, b)`` with ``a'c = b`` at every point, for functions scaled by how much they vary."""
    if len(values) < 2:
        return np.zeros((0, 2))
    F = np.asarray(values).T
    scale = np.abs(F - F.mean(axis=0)).max(axis=0)
    F = F / np.where(scale > 0, scale, 1)
    mean = F.mean(axis=0)
    A = null_space(F - mean, rcond=1e-10 + 1e-15 * np.abs(F).max()).T
    return np.hstack([A, (A @ mean)[:, None]])


def _margin(relations, signs):
    """The largest m <= 1 such that some point has sign_k c_k >= m for all signs but 0; -inf if there is none.

    Above 0 the signs occur together, at 0 only where the surfaces meet.
    """
    signs = np.array(signs)
    if not len(relations):
        return 1.0
    n, asked = len(signs), np.flatnonzero(signs)
    result = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=np.hstack([-np.diag(signs)[asked], np.ones((len(asked), 1))]),
        b_ub=np.zeros(len(asked)),
        A_eq=np.hstack([relations[:, :-1], np.zeros((len(relations), 1))]),
        b_eq=relations[:, -1],
        bounds=[(None, None)] * n + [(None, 1.0)],
    )
    return -result.fun if result.status == 0 else -np.inf
