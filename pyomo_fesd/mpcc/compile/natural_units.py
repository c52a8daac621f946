"""Units in which an MPCC is of order one, from the numbers of the model itself.

Tolerances, the trust region and Ipopt are absolute, so a model in unfortunate units (times in seconds that are 1e-8, an objective
of 1e-10, a row times 1e-6) would be judged by round-off.  Sizes of variables come from what is certain: coefficients that do not
depend on the point, right-hand sides, finite bounds, and the coefficients of a quadratic objective.  In natural units c (variables)
and r (rows) all of them are as near to 1 as possible:

    min sum (log|a_ij| + log c_j - log r_i)^2 + (log|b_i| - log r_i)^2 + ...          (Curtis, Reid 1972)

Ordinary models stay as they are: only sizes, rows and objectives far from 1 are changed, and only where the user gave no factor.

Takes: an ``MpccFunctions`` in the user's units.
Leaves: further factors, powers of 2, and the part of the objective that does not matter.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import lsqr

from pyomo_fesd.mpcc.compile.casadi_matrices import csr
from pyomo_fesd.mpcc.compile.scaling import MILD
from pyomo_fesd.mpcc.compile.sparse_entries import largest_entries, major_index, with_entries

#: Variables of a size within these bounds keep their unit: small ones are measured by 1, large ones by their value.
ORDINARY = (1e-2, 1e4)
#: So does an objective that changes by this much over the sizes of the variables.
ORDINARY_OBJECTIVE = (1e-3, 1e6)
#: An objective of this many times its own changes consists of an offset.
OFFSET = 10.0
#: Numbers beyond these bounds are no evidence, nor are bounds of variables that stand for infinity.
EVIDENCE, FINITE = (1e-30, 1e30), 1e15
#: A constant below this part of the terms that cancel in it is round-off.
ROUND_OFF = 1e-12
#: Weight of bounds, which are often generous, and of the guess that a size is 1.
BOUNDS, GUESS = 0.3, 1e-2
#: Points, besides the start, at which functions are sampled.
SAMPLES, SEED = 2, 0
#: A start may be this many sizes away from 0; one that is farther is not typical.
FARTHEST = 1e3
#: An objective with more operations than this is not differentiated twice to find sizes.
LONG = 20000


@dataclass(frozen=True)
class NaturalUnits:
    """Factors of variables (n), rows (m) and the objective besides the user's, and the objective's offset in the user's units."""

    x: np.ndarray
    g: np.ndarray
    f: float
    offset: float

    @property
    def ordinary(self):
        """Whether nothing changes."""
        return self.f == 1.0 and self.offset == 0.0 and np.all(self.x == 1.0) and np.all(self.g == 1.0)


def natural_units(c, sized: bool) -> NaturalUnits:
    """Return the natural units of a compiled MPCC ``c`` in which every factor of the user is in force.

    Parameters
    ----------
    sized : bool
        whether variables and rows have their factors already, so that only the objective gets one
    """
    if sized and not _scales_objective(c):
        return NaturalUnits(np.ones(len(c.x0)), np.ones(len(c.lbg)), 1.0, 0.0)
    typical = np.ones(len(c.x0)) if sized else np.where(c.scale.x == 1.0, _sizes(c), 1.0)
    sizes = np.where((typical < ORDINARY[0]) | (typical > ORDINARY[1]), _power(typical), 1.0)
    points = _samples(c, typical)
    gradients = [c.gradients(w) for w in points]
    rows = np.max([_largest(J_g, sizes) for _, J_g, *_ in gradients], axis=0)
    small = (rows < MILD[0]) & (rows > EVIDENCE[0]) & (c.scale.g == 1.0) & (not sized)
    factors = np.where(small, _power(1.0 / np.where(small, rows, 1.0)), 1.0)
    return NaturalUnits(1.0 / sizes, factors, *_objective(c, points, gradients, typical))


def _scales_objective(c):
    """Whether there is an objective without a factor of the user."""
    return c.has_objective and c.scale.f == 1.0


def _objective(c, points, gradients, sizes):
    """Factor and offset of the objective."""
    if not _scales_objective(c):
        return 1.0, 0.0
    values = np.array([c.evaluate(w).f for w in points])
    reach = float(np.max([np.nan_to_num(np.abs(grad), nan=0.0, posinf=0.0) * sizes for grad, *_ in gradients], initial=0.0))
    finite = values[np.isfinite(values)]
    changes = max(reach, float(np.abs(finite - values[0]).max(initial=0.0))) if np.isfinite(values[0]) else 0.0
    offset = float(values[0]) if abs(values[0]) > OFFSET * changes > 0.0 else 0.0
    ordinary = ORDINARY_OBJECTIVE[0] <= reach <= ORDINARY_OBJECTIVE[1]
    return 1.0 if ordinary or not EVIDENCE[0] < reach else float(_power(1.0 / reach)), offset


def _samples(c, sizes):
    """The start, or one that is nearer to 0, and points away from it by the size of each variable, within bounds."""
    random = np.random.default_rng(SEED)
    start = np.clip(np.clip(c.x0, -FARTHEST * sizes, FARTHEST * sizes), c.lbx, c.ubx)
    points = [start]
    for _ in range(SAMPLES):
        step = np.maximum(sizes, np.abs(start)) * random.uniform(-1, 1, len(start))
        points.append(np.clip(start + step, c.lbx, c.ubx))
    return points


def _largest(J, sizes):
    """The largest entry of each row over the sizes, 0 for what cannot be evaluated."""
    return largest_entries(with_entries(J, np.nan_to_num(np.abs(J.data * sizes[J.indices]), nan=0.0, posinf=0.0)))


def _sizes(c):
    """Sizes of the variables, 1 in an ordinary model."""
    n, evidence, (columns, bounds) = len(c.x0), _evidence(c), _bounds(c)
    if evidence.ordinary(bounds):
        return np.ones(n)
    return np.exp(evidence.fit(n, columns, bounds))


def _power(number):
    """The nearest power of 2: scaling by it is exact."""
    return 2.0 ** np.round(np.log2(number))


@dataclass(frozen=True)
class _Evidence:
    """Numbers of which those of one row, each times the sizes of up to two variables, should be of the same size.

    ``first`` and ``second`` are the variables of each number, n where there is none.
    """

    row: np.ndarray
    first: np.ndarray
    second: np.ndarray
    logarithm: np.ndarray

    @classmethod
    def of(cls, row, first, second, numbers):
        """Without zeros and without rows of a single number, which show nothing."""
        size = np.abs(numbers)
        kept = (size > EVIDENCE[0]) & (size < EVIDENCE[1])
        _, own, count = np.unique(row[kept], return_inverse=True, return_counts=True)
        several = count[own] > 1
        _, own = np.unique(own[several], return_inverse=True)
        return cls(own, first[kept][several], second[kept][several], np.log(size[kept][several]))

    def ordinary(self, bounds):
        """Whether all numbers of each row, and all bounds, are of similar size."""
        least, most = np.full(self._rows, np.inf), np.full(self._rows, -np.inf)
        np.minimum.at(least, self.row, self.logarithm)
        np.maximum.at(most, self.row, self.logarithm)
        wide = -np.log(ORDINARY[0])
        return np.all(most - least < wide) and np.all(np.abs(np.log(bounds)) < wide)

    def fit(self, n, columns, bounds):
        """Logarithms of the n sizes by least squares; ``columns`` have ``bounds``."""
        m, k = len(self.row), np.arange(len(self.row))
        parts = [(k, self.first, 1.0), (k, self.second, 1.0), (k, n + 1 + self.row, -1.0)]
        parts += [(m + np.arange(len(columns)), columns, BOUNDS), (m + len(columns) + np.arange(n), np.arange(n), GUESS)]
        i, j, v = (np.concatenate(some) for some in zip(*((i, j, np.full(len(i), v)) for i, j, v in parts)))
        # column n is that of numbers without a variable
        known, j = j != n, j - (j > n)
        stacked = sparse.csr_matrix((v[known], (i[known], j[known])), (m + len(columns) + n, n + self._rows))
        right = np.concatenate([-self.logarithm, BOUNDS * np.log(bounds), np.zeros(n)])
        return lsqr(stacked, right, atol=1e-10, btol=1e-10)[0][:n]

    @property
    def _rows(self):
        return int(self.row.max(initial=-1)) + 1


def _bounds(c):
    """Variables with a finite bound that is not 0, and the smallest one."""
    sizes = [np.where((np.abs(b) > EVIDENCE[0]) & (np.abs(b) < FINITE), np.abs(b), np.inf) for b in (c.lbx, c.ubx)]
    smallest = np.minimum(*sizes)
    columns = np.flatnonzero(np.isfinite(smallest) & ~(c.lbx == c.ubx))
    return columns, smallest[columns]


def _evidence(c):
    """Constant coefficients and right-hand sides of rows and sides, and the coefficients of a quadratic objective."""
    points = _samples(c, np.ones(len(c.x0)))[:2]
    at, q = c.evaluate(points[0]), len(c.side_of)
    here, there = [c.stacked_jacobian(w)[: len(c.lbg) + q] for w in points]
    values = np.concatenate([at.g, at.G, at.H])
    bounds = [np.concatenate([b, np.zeros(q)]) for b in (c.lbg, c.ubg)]
    cancelling = c.parameter_terms(points[0])
    # a side need not be zero: its constant shows no small size either
    hidden = _hides_sizes(here, c.lbx, c.ubx) | (np.arange(len(values)) >= len(c.lbg))
    parts = [_linear(here, there, values, bounds, points[0], cancelling, hidden), _quadratic(c, len(values))]
    return _Evidence.of(*(np.concatenate(arrays) for arrays in zip(*parts)))


def _hides_sizes(J, lbx, ubx):
    """Mask over the rows of J (csr) whose value may be far smaller than the variables.

    Their terms may cancel, or the only one may be an initial value near 0.
    """
    with np.errstate(invalid='ignore'):
        ends = np.sort(np.nan_to_num([J.data * bound[J.indices] for bound in (lbx, ubx)]), axis=0)
    row, count = major_index(J), np.diff(J.indptr)
    positive, negative = (np.bincount(row, sign, J.shape[0]) == count for sign in (ends[0] >= 0.0, ends[1] <= 0.0))
    return (count == 1) | ~(positive | negative)


def _linear(here, there, values, bounds, w, cancelling, hidden):
    """(row, variable, none, number) of the coefficients that are equal in two Jacobians (csr of one pattern), and of what is left
    in linear rows.

    ``cancelling`` are the sizes of terms without variables; the right-hand side of a ``hidden`` one is no evidence where it is
    smaller than the coefficients.
    """
    n, m, largest, at = len(w), np.arange(len(values)), largest_entries(here), major_index(here)
    changed = here.data != there.data
    varies = np.bincount(at[changed], minlength=len(m)) > 0
    products = here.data * w[here.indices]
    terms, sizes = np.bincount(at, products, len(m)), np.bincount(at, np.abs(products), len(m)) + cancelling
    left = values - terms
    left = np.where(np.abs(left) > ROUND_OFF * np.maximum(np.abs(values), sizes), left, 0.0)
    left = np.where(varies, 0.0, left)
    sides = [np.where(np.isfinite(b), b, 0.0) - np.where(np.isfinite(b), left, 0.0) for b in bounds]
    # an equation's right-hand side counts once
    equation = sides[0] == sides[1]
    sides[1] = np.where(equation, 0.0, sides[1])
    sides[0] = np.where(equation & hidden & (np.abs(sides[0]) < largest), 0.0, sides[0])
    row, first = np.concatenate([at[~changed], m, m]), np.concatenate([here.indices[~changed], np.full(2 * len(m), n)])
    numbers = np.concatenate([here.data[~changed], *sides])
    return row, first, np.full(len(row), n), np.nan_to_num(numbers, posinf=0.0, neginf=0.0)


def _quadratic(c, row):
    """The same of the objective, a row of its own."""
    n, none = len(c.x0), (np.zeros(0, dtype=int),) * 3 + (np.zeros(0),)
    if not c.has_objective:
        return none
    x, p, f = c.x, c.p, c.f
    if not c.short:
        objective = ca.Function('f', [x, p], [f]).expand()
        if objective.n_instructions() > LONG:
            return none
        x, p = objective.sx_in()
        f = objective(x, p)
    hessian = ca.hessian(f, x)[0]
    if hessian.nnz() and ca.depends_on(hessian.nz[:], x):
        return none
    H = csr(ca.Function('H', [x, p], [hessian])(c.x0, c.parameters)).tocoo()
    linear = c.gradients(np.zeros(n))[0]
    first, second = np.concatenate([H.row, np.arange(n)]), np.concatenate([H.col, np.full(n, n)])
    return np.full(len(first), row), first, second, np.concatenate([H.data, linear])
