"""How much a linear program descends, by a measure that no unit and no offset of the objective changes.

For every y:  cost' d = (cost - A' y)' d + y' A d.  Over the box and the rows' bounds each term is bounded on its own, so the sum of
these bounds is a lower bound of the program's value, whoever gave y; with the multipliers of a solution it is the value itself.

A term counts relative to the terms that cancel in it.  For column j these are

    N_j = reach_j (|cost_j| + sum_i |A_ij y_i| + sum_k |d2L/dw_j dw_k| reach_k)

that is, what the reduced cost would be without the cancellation, and how it changes where w does: descent_j / N_j below 1e-6 means
that a point within 1e-6 reach has no descent there.  Neither factors of f, w and rows nor an offset of f change this ratio.  Terms
below FLOOR times the largest N of the objective alone are round-off of the NLP solver.
"""

from copy import copy
from functools import cached_property

import numpy as np

from pyomo_fesd.mpcc.compile import major_index

#: Terms below this part of the objective's largest gradient entry (or change of it) over the reach are round-off.
FLOOR = 1e-8
#: A multiplier with the wrong sign is round-off below this part of the largest one.
WRONG_SIGN = 1e-9
#: Smaller sizes are zero.
SMALLEST = 1e-200


class Descent:
    """Measures the descent of one program.

    Parameters
    ----------
    program : Program
        without binaries; its rows are csr
    changes : callable -> list of (array (n), callable y -> array (n))
        changes of cost and of A' y, each along a displacement by the reach of every variable
    """

    def __init__(self, program, changes):
        self._p, self._terms = program, _Terms(program, changes)

    def of(self, program):
        """The same for a program that differs in its bounds only."""
        other = copy(self)
        other._p = program
        return other

    def with_rows(self, program, own):
        """The same for a program with more rows, which never change; ``own(y)`` are the multipliers of the others."""
        return Descent(
            program, lambda: [(cost, lambda y, of_rows=of_rows: of_rows(own(y))) for cost, of_rows in self._terms.changes]
        )

    def value(self, d) -> float:
        """The change of the objective along ``d``."""
        return float(self._p.cost @ d)

    def proved(self, y) -> float:
        """The largest relative descent that multipliers ``y`` (rows, positive at ``low``) leave possible."""
        p = self._p
        (m, n), A, row, entries = p.A.shape, p.A, self._terms.row, self._terms.entries
        y, columns, rows = self._bounds(y)
        products = entries * np.abs(y)[row]
        size = (np.abs(p.cost) + np.bincount(A.indices, products, n) + self._curvature(y)) * p.reach
        floor = FLOOR * self._terms.reach_of_objective
        by_columns = _ratios(columns, size, floor)
        # a row's term is y_i times its slack: as large as its part in a column, and relative to what the row can move
        of_rows = np.zeros(m)
        np.maximum.at(of_rows, row, products * (p.reach / np.where(size > SMALLEST, size, 1.0))[A.indices])
        extent = np.abs(y) * np.bincount(row, entries * p.reach[A.indices], m)
        by_rows = _ratios(rows, extent, floor) * np.minimum(of_rows, 1.0)
        return float(max(by_columns.max(initial=0.0), by_rows.max(initial=0.0)))

    def proved_of_sums(self, y, steps, clipped) -> tuple[float, float]:
        """``proved`` and ``least`` at their worst, of multipliers ``y`` plus any of the ``steps``, each or not.

        Parameters
        ----------
        clipped : array (m)
            by how much multipliers have the wrong sign for a bound that their rows have with some of the sums only; they are set to
            zero, and where that is more than round-off nothing is proved
        """
        p = self._p
        m, A, row, entries = len(y), p.A, self._terms.row, self._terms.entries
        along = [self._by_columns(A.data * step[row]) for step in steps]
        y_low, y_high = _between(y, steps)
        clipped = clipped + np.where(np.isneginf(p.low), np.maximum(y_high, 0.0), 0.0)
        clipped = clipped + np.where(np.isposinf(p.high), np.maximum(-y_low, 0.0), 0.0)
        if clipped.max(initial=0.0) > WRONG_SIGN * np.abs(y).max(initial=0.0):
            return np.inf, -np.inf
        lost = self._by_columns(entries * clipped[row])
        low, high = _between(p.cost - self._by_columns(A.data * y[row]), [-part for part in along])
        columns = np.maximum(-_least(low - lost, p.lower, p.upper), -_least(high + lost, p.lower, p.upper))
        y_low = np.where(np.isposinf(p.high), np.maximum(y_low, 0.0), y_low)
        y_high = np.where(np.isneginf(p.low), np.minimum(y_high, 0.0), y_high)
        slack = np.maximum(np.where(y_high > 0, -p.low, 0.0), np.where(y_low < 0, p.high, 0.0))
        most = np.maximum(np.abs(y_low), np.abs(y_high))
        least = np.where(y_low * y_high > 0, np.minimum(np.abs(y_low), np.abs(y_high)), 0.0)
        size = (np.abs(p.cost) + self._by_columns(entries * least[row]) + self._least_curvature(y, steps)) * p.reach
        floor, rows = FLOOR * self._terms.reach_of_objective, most * slack
        of_rows = np.zeros(m)
        np.maximum.at(of_rows, row, entries * most[row] * (p.reach / np.maximum(size, SMALLEST))[A.indices])
        by_rows = _ratios(rows, most * np.bincount(row, entries * p.reach[A.indices], m), floor) * np.minimum(of_rows, 1.0)
        by_columns = np.where(columns > floor, columns / np.maximum(size, SMALLEST), 0.0)
        return float(max(by_columns.max(initial=0.0), by_rows.max(initial=0.0))), -float(columns.sum() + rows.sum())

    def least(self, y) -> float:
        """The lower bound of the program's value that multipliers ``y`` prove."""
        _, columns, rows = self._bounds(y)
        return -float(columns.sum() + rows.sum())

    def negligible(self, value, floor=FLOOR) -> bool:
        """Whether a value of the program is round-off: below the part ``floor`` of the objective's largest term."""
        # the changes, which take longer to find than a small program to solve, only make the largest term larger
        least = float(np.max(np.abs(self._p.cost) * self._p.reach, initial=0.0))
        return -value <= floor * least or -value <= floor * self._terms.reach_of_objective

    def _bounds(self, y):
        """Multipliers of the right sign, and by how much each column and each row may descend."""
        p = self._p
        y = np.where(np.isneginf(p.low), np.minimum(y, 0.0), y)
        y = np.where(np.isposinf(p.high), np.maximum(y, 0.0), y)
        reduced = p.cost - np.bincount(p.A.indices, p.A.data * y[self._terms.row], len(p.cost))
        return y, -_least(reduced, p.lower, p.upper), -_least(y, p.low, p.high)

    def _by_columns(self, numbers):
        """Sums over the entries of each column."""
        return np.bincount(self._p.A.indices, numbers, len(self._p.cost))

    def _least_curvature(self, y, steps):
        """The least that ``_curvature`` may be of ``y`` plus any of the ``steps``."""
        found = np.zeros(len(self._p.cost))
        for cost, of_rows in self._terms.changes:
            found = np.maximum(found, np.abs(cost - of_rows(y)) - sum(np.abs(of_rows(step)) for step in steps))
        return found

    def _curvature(self, y):
        along = [np.abs(cost - of_rows(y)) for cost, of_rows in self._terms.changes]
        return np.max(along, axis=0) if along else 0.0


class _Terms:
    """Terms of a program that are the same whatever its bounds; found when they are first needed.

    Attributes
    ----------
    row, entries : arrays
        row and size of each coefficient
    changes : list
        as given to ``Descent``
    reach_of_objective : float
        the largest term of the objective
    """

    def __init__(self, program, changes):
        self._p, self._changes = program, changes

    @cached_property
    def row(self):
        return major_index(self._p.A)

    @cached_property
    def entries(self):
        return np.abs(self._p.A.data)

    @cached_property
    def changes(self):
        return self._changes()

    @cached_property
    def reach_of_objective(self):
        sizes = [np.abs(self._p.cost), *(np.abs(cost) for cost, _ in self.changes)]
        return float(np.max(np.max(sizes, axis=0) * self._p.reach, initial=0.0))


def _between(at, steps):
    """The least and the largest sums of ``at`` and any of the ``steps``, elementwise."""
    return at + sum(np.minimum(step, 0.0) for step in steps), at + sum(np.maximum(step, 0.0) for step in steps)


def _ratios(terms, sizes, floor):
    return np.where(terms > floor, terms / np.where(sizes > 0, sizes, 1.0), 0.0)


def _least(factor, low, high):
    """The least factor * v over low <= v <= high, elementwise, never positive as 0 is among them."""
    at = np.where(factor > 0, low, high)
    return np.minimum(np.where(factor == 0, 0.0, factor * np.where(factor == 0, 0.0, at)), 0.0)
