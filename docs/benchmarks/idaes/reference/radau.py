"""Radau's scheme with three points for F(w) = 0, with steps of controlled length, which end where a mode ends."""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.optimize import brentq
from scipy.sparse.linalg import splu

S6 = np.sqrt(6.0)
#: Coefficients of Radau IIA of order 5, and its points.
A = np.array(
    [
        [(88 - 7 * S6) / 360, (296 - 169 * S6) / 1800, (-2 + 3 * S6) / 225],
        [(296 + 169 * S6) / 1800, (88 + 7 * S6) / 360, (-2 - 3 * S6) / 225],
        [(16 - S6) / 36, (16 + S6) / 36, 1 / 9],
    ]
)
ORDER, NEWTON_STEPS = 5, 25
#: Largest residual of a solution relative to the terms of its row: round-off.
EXACT = 1e-13
#: The matrix of Newton's method stays as long as a change is below this part of the one before.
CONTRACTION = 0.05
#: Unknowns of a step up to which a dense factorisation is faster.
DENSE = 200


class NoStep(Exception):
    """Newton's method has not converged; the step is tried shorter."""


class Failure(Exception):
    """The reference cannot be computed."""


@dataclass
class Path:
    """Result of an integration.

    Attributes
    ----------
    switches : list of (time, mode before, mode after)
    end : dict, states at the end by their names
    scale : dict, largest magnitude of each state on the way
    steps : int
    """

    switches: list = field(default_factory=list)
    end: dict = field(default_factory=dict)
    scale: dict = field(default_factory=dict)
    steps: int = 0


def integrate(stages, tolerance=1e-7, longest=0.05, slack=1e-9, begin=(1e-6, 1e-3, 1)):
    """Integrate over stages, each with its own equations.

    Parameters
    ----------
    stages : list of (float, Equations)
        the end of each stage; the first begins where its model does, at ``stages[0][1].begin`` or 0
    tolerance : float
        of a step, relative to the largest magnitude of a state
    longest : float
        step, relative to the horizon
    slack : float
        by which a guard may be negative, relative to its size at the beginning
    begin : tuple of float
        lengths tried for the first step, parts of 1e-3 ``longest``.  Where equations tie derivatives of states (a higher index),
        round-off grows by 1/h or more in a short step

    Raises
    ------
    Failure
        where no mode holds, as in sliding, or steps vanish
    """
    path, t, w, mode, largest = Path(), 0.0, None, None, 0.0
    horizon = stages[-1][0]
    for end, equations in stages:
        run = _Run(equations, tolerance, slack, horizon, begin)
        x = run.first if w is None else w[equations.states]
        run.size = np.maximum(run.size, largest)
        t, w, mode = run.to(end, t, x, mode, longest * horizon, path)
        largest = run.size
    path.end = {equations.names[p]: w[p] for p in equations.states}
    path.scale = dict(zip((equations.names[p] for p in equations.states), run.size))
    return path


class _Run:
    """Steps with the equations of one stage."""

    def __init__(self, equations, tolerance, slack, horizon, begin):
        self.eq, self.tolerance, self.slack, self.horizon, self.begin = equations, tolerance, slack, horizon, begin
        self.first, self.size = equations.first, np.abs(equations.first)
        count, n = len(equations.states), len(equations.names)
        numbers, ones = np.arange(count), np.ones(count)
        # changes of rates count with those of the states
        self._algebraic = np.setdiff1d(np.arange(n), [*equations.states, *equations.rates])
        pick = [sp.csr_matrix((ones, (numbers, where)), (count, n)) for where in (equations.states, equations.rates)]
        self._states, self._rates = sp.kron(sp.eye(3), pick[0]).tocsr(), sp.kron(A, pick[1]).tocsr()
        if 3 * n <= DENSE:
            self._states_full, self._rates_full = self._states.toarray(), self._rates.toarray()

    def to(self, end, t, x, mode, longest, path):
        """Integrate to ``end``; returns the last time, w and mode."""
        h, w = min(longest, end - t) * 1e-3, np.tile(self.eq.guess, (3, 1))
        mode, w, length = self._begin(x, h, w, mode)
        x, t = w[2][self.eq.states], t + length  # states that are tied by equations hold them now
        while end - t > 1e-12 * self.horizon:
            h = min(h, end - t, longest)
            try:
                new, error = self._double(x, h, w, mode)
            except NoStep:
                h = self._shorter(h / 4)
                continue
            if error > 1:
                h = self._shorter(h * max(0.2, 0.9 * error ** (-1 / (ORDER + 1))))
                continue
            path.steps += 1
            if self._violated(new[2], mode):
                t, x, w, mode, h = self._switch(t, x, h, w, mode, path)
                continue
            t, x, w = t + h, new[2][self.eq.states], new
            self.size = np.maximum(self.size, np.abs(x))
            h *= min(4.0, 0.9 * max(error, 1e-6) ** (-1 / (ORDER + 1)))
        return end, w[2], mode

    def _shorter(self, h):
        if h < 1e-14 * self.horizon:
            raise Failure("the steps vanish")
        return h

    def _begin(self, x, h, guess, mode):
        """A mode that holds over a first short step, its values and length; the present mode is tried first."""
        for candidate in sorted(self.eq.modes, key=lambda other: (_changes(other, mode), other)):
            for length in (part * h for part in self.begin):
                try:
                    w = self._step(x, length, guess, candidate)
                except NoStep:
                    continue
                if not self._violated(w[2], candidate):
                    return candidate, w, length
                break
        raise Failure("no mode holds (sliding, or no solution at the start)")

    def _switch(self, t, x, h, w, mode, path):
        """The end of a mode within the step, and the mode that follows."""

        def least(length):
            at = w if length == 0 else self._step(x, length, w, mode)
            return min(self.eq.guards(at[2], mode))

        length = 1e-9 * h if least(0) <= 0 else brentq(least, 0, h, xtol=1e-14 * self.horizon, rtol=1e-14)
        w = self._step(x, length, w, mode)
        x, t = w[2][self.eq.states], t + length
        self.size = np.maximum(self.size, np.abs(x))
        others = [other for other in self.eq.modes if other != mode]
        after, w = self._follow(x, min(h, 1e-4 * self.horizon), w, others, mode)
        path.switches.append((t, mode, after))
        if len(path.switches) > 200:
            raise Failure("more than 200 switches")
        return t, x, w, after, min(h, 1e-4 * self.horizon)

    def _follow(self, x, h, guess, others, mode):
        for candidate in sorted(others, key=lambda other: (_changes(other, mode), other)):
            for length in (h, h * 1e-2, h * 1e-4):
                try:
                    w = self._step(x, length, guess, candidate)
                except NoStep:
                    continue
                if not self._violated(w[2], candidate):
                    return candidate, w
        raise Failure("no mode follows (sliding)")

    def _violated(self, w, mode):
        guards = self.eq.guards(w, mode)
        return guards.size and guards.min() < -self.slack * max(1.0, np.abs(guards).max())

    def _double(self, x, h, guess, mode):
        """Two half steps; their values and the error estimate relative to the tolerance."""
        one = self._step(x, h, guess, mode)
        half = self._step(x, h / 2, one, mode)
        two = self._step(half[2][self.eq.states], h / 2, one, mode)
        size = np.maximum(self.size, np.abs(two[2][self.eq.states]))
        difference = np.abs(two[2] - one[2])[self.eq.states] / (2**ORDER - 1)
        return two, max(difference / (self.tolerance * size + 1e-14 * max(size, default=1)), default=0.0)

    def _step(self, x, h, guess, mode):
        """The values w at the three points of a step of length h from states x."""
        eq, n = self.eq, len(self.eq.names)
        w = guess.copy()
        w[:, eq.states] = x + h * A @ w[:, eq.rates]
        previous, solve = np.inf, None
        for _ in range(NEWTON_STEPS):
            fresh = solve is None
            if fresh:
                residual, matrix = self._system(w, x, h, mode)
                solve, matrix = _factors(matrix), abs(matrix)
            else:
                residual = self._residual(w, x, h, mode)
            if not np.isfinite(residual).all():
                raise NoStep
            # at rest rates consist of round-off, and their changes are as large: no row says more then
            exact = (np.abs(residual) <= EXACT * (matrix @ np.abs(w.ravel()))).all()
            change = solve(residual).reshape(3, n)
            damping = 1.0
            while damping > 1e-3 and not np.isfinite(self._residual(w - damping * change, x, h, mode)).all():
                damping /= 2
            w = w - damping * change
            size = self._size_of(w, change, h)
            algebra = (np.abs(change).max(axis=0) / (np.abs(w).max(axis=0) + 1e-9 * np.abs(w).max()))[self._algebraic]
            settled = size < 1e-12 or (fresh and size < 1e-8 and size > 0.3 * previous)
            if damping == 1 and (exact or algebra.max(initial=0.0) < 1e-7) and settled:
                return w
            if damping < 1 or previous == np.inf or size > CONTRACTION * previous:
                solve = None
            previous = size
        raise NoStep

    def _size_of(self, w, change, h):
        """The change of states, and of what their rates give in the step, relative to the magnitude of each.

        Algebraic variables follow; some of them, such as a work that is zero, consist of round-off.
        """
        eq = self.eq
        size = np.maximum(self.size, np.abs(w[:, eq.states]).max(axis=0))
        size = np.maximum(size, 1e-12 * size.max(initial=0)) + (size.max(initial=0) == 0)
        both = np.abs(change[:, eq.states]) + h * np.abs(change[:, eq.rates])
        return (both / size).max(initial=0.0)

    def _residual(self, w, x, h, mode):
        eq = self.eq
        algebra = [eq.residual(point, mode) for point in w]
        return np.concatenate([*algebra, (w[:, eq.states] - x - h * A @ w[:, eq.rates]).ravel()])

    def _system(self, w, x, h, mode):
        if w.size > DENSE:
            algebra = sp.block_diag([self.eq.jacobian(point, mode) for point in w])
            return self._residual(w, x, h, mode), sp.vstack([algebra, self._states - h * self._rates]).tocsc()
        n, blocks = w.shape[1], [self.eq.jacobian(point, mode).toarray() for point in w]
        rows = len(blocks[0])
        matrix = np.zeros((3 * rows + self._states.shape[0], 3 * n))
        for k, block in enumerate(blocks):
            matrix[k * rows : (k + 1) * rows, k * n : (k + 1) * n] = block
        matrix[3 * rows :] = self._states_full - h * self._rates_full
        return self._residual(w, x, h, mode), matrix


def _factors(matrix):
    """A function that solves with a matrix; rows and columns are brought to size one, twice in turn."""
    if matrix.shape[0] != matrix.shape[1]:
        raise Failure(f"{matrix.shape[0]} equations for {matrix.shape[1]} unknowns")
    row, column, dense = np.ones(matrix.shape[0]), np.ones(matrix.shape[0]), isinstance(matrix, np.ndarray)
    size = abs(matrix)
    for _ in range(2):
        row = 1 / _positive(_largest(size @ _diagonal(column, dense), 1))
        column = 1 / _positive(_largest(_diagonal(row, dense) @ size, 0))
    scaled = _diagonal(row, dense) @ matrix @ _diagonal(column, dense)
    solve = _dense_factors(scaled) if dense else _sparse_factors(scaled)
    return lambda rhs: column * solve(row * rhs)


def _dense_factors(matrix):
    factors, pivots, info = lapack.dgetrf(matrix)
    if info:
        raise NoStep
    return lambda rhs: lapack.dgetrs(factors, pivots, rhs)[0]


def _sparse_factors(matrix):
    try:
        return splu(matrix.tocsc()).solve
    except RuntimeError as error:
        raise NoStep from error


def _diagonal(factors, dense):
    return np.diag(factors) if dense else sp.diags(factors)


def _largest(size, axis):
    found = size.max(axis=axis)
    return found if isinstance(found, np.ndarray) else found.toarray().ravel()


def _positive(numbers):
    return np.where(numbers > 0, numbers, 1.0)


def _changes(one, other):
    return 0 if other is None else sum(a != b for a, b in zip(one, other))
