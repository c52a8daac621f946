"""Solutions that are not unique: on a surface from which both modes lead away, a Filippov system can stay or leave at any time.

With the rate cdot of the switching function, and nu the multiplier of the mode where c > 0, this happens where

    cdot(nu = 1) > 0 > cdot(nu = 0)

at the first time with c = 0, or in a sliding mode (which then repels).  Where several surfaces meet, cdot = r + S nu for all of
them, and the other multipliers change when one surface is left.  So all choices are counted: a surface is left upwards
(nu = 1, cdot > 0), downwards (nu = 0, cdot < 0), or kept (0 < nu < 1, cdot = 0).

Takes: a solved model with a moving grid.
Leaves: messages.
Does not apply: to switching functions that contain algebraic variables, and where the equations do not determine the rates by nu
alone.  Where more than MOST surfaces meet, the other multipliers stay as they are, and a message may be a false alarm.
"""

from collections import defaultdict
from collections.abc import Iterator
from itertools import product

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import ContinuousSet
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import lsqr

from pyomo_fesd.core import (
    TimeIndex,
    all_switched_systems,
    derivatives,
    gradient,
    is_discretisation_equation,
    moving_grids,
    own_components,
)
from pyomo_fesd.results import SwitchingFunction, largest_value, physical_time

#: A switching function below this part of its largest value is zero; a multiplier farther than this from 0 and 1 slides.
ZERO, SLIDING = 1e-7, 1e-6
#: Accuracy of the linear equations, and of a system that counts as solved; a smaller change, relative to the largest, is none.
EXACT, SOLVED, CHANGES = 1e-10, 1e-6, 1e-9
#: Largest number of surfaces at one point whose choices are counted.
MOST = 5


def not_unique(model: Block, wrt: ContinuousSet, functions: list[SwitchingFunction]) -> Iterator[str]:
    """Yield messages for boundaries from which both modes lead away."""
    moving, time, rates = moving_grids(model)[wrt], None, None
    # those of one Disjunction have the same name
    zeros = {id(s): ZERO * largest_value(s.values) for s in functions}
    for s in functions:
        for label in _meetings(s, zeros[id(s)], moving):
            rates = rates or _Rates(model, wrt)
            if rates.slope(s, s, label) > 0 and _leaves_choices(rates, s, _others(s, functions, zeros, label), label):
                time = time or physical_time(model, wrt)
                yield (
                    f"{s.name}: at time {time[label]:.6g} both modes lead away from their boundary: the solution is "
                    "not unique, it may stay there or leave at any time. One of them is shown. Start off the boundary."
                )
                break


def _others(s, functions, zeros, label):
    """The other switching functions that are zero at ``label``."""
    there = (o for o in functions if o is not s and label in o.c)
    return [o for o in there if abs(o.values[label]) <= zeros[id(o)]]


def _leaves_choices(rates, s, others, label):
    """Whether more than one way of leaving and keeping the surfaces of ``s`` and of those coupled with it is possible."""
    met = _coupled(rates, s, others, label)
    if len(met) > MOST:
        return True
    S = np.array([[rates.slope(row, column, label) for column in met] for row in met])
    rest = np.array([rates.rate(o, label) for o in met]) - S @ [o.nu[label].value for o in met]
    return sum(_is_possible(rest, S, ways) for ways in product((0, 1, None), repeat=len(met))) > 1


def _coupled(rates, s, others, label):
    """``s`` and those of the ``others`` whose multipliers change its rate and change by it, directly or through one another."""
    met, left = [s], list(others)
    for known in met:
        near = [o for o in left if rates.slope(known, o, label) and rates.slope(o, known, label)]
        left = [o for o in left if all(o is not n for n in near)]
        met.extend(near)
    return met


def _is_possible(rest, S, ways):
    """Whether rates rest + S nu suit the surfaces that are left downwards (0), upwards (1), and kept (None)."""
    nu, kept = np.array([way or 0.0 for way in ways]), [i for i, way in enumerate(ways) if way is None]
    inner = S[np.ix_(kept, kept)]
    if np.linalg.matrix_rank(inner) < len(kept):
        return False
    nu[kept] = np.linalg.solve(inner, -(rest + S @ nu)[kept])
    leaving = (rest + S @ nu) * [0 if way is None else 2 * way - 1 for way in ways]
    return all(SLIDING < nu[i] < 1 - SLIDING for i in kept) and all(leaving[i] > 0 for i in range(len(ways)) if i not in kept)


def _meetings(s, zero, moving):
    """Labels where c = 0 and either mode is possible: the first time, and where a slide begins."""
    first, before = moving.wrt.first(), False
    if moving.begin in (None, first) and first in s.c and abs(s.values[first]) <= zero:
        yield first
    for element in moving.grid.elements:
        label = element.points[0]
        slides = label in s.c and abs(s.values[label]) <= zero and SLIDING < s.nu[label].value < 1 - SLIDING
        if slides and not before and element in moving.new_elements:
            yield label
        before = slides


class _Rates:
    """Rates of switching functions, by the equations at a label."""

    def __init__(self, model, wrt):
        self._rates = ComponentMap((d.get_state_var(), d) for d in derivatives(model, wrt))
        systems, moving = all_switched_systems(model), moving_grids(model)[wrt]
        held = [v for c in (moving.held or {}).values() for v in identify_variables(c.body)]
        self._given = ComponentSet([*systems.selectors, *systems.continuous, *held])
        self._conditions = moving.complementarities
        rows = (c for c in own_components(model, Constraint, Block, active=True) if not is_discretisation_equation(c))
        self._families, self._linear = list(TimeIndex(wrt).families_in(rows).values()), {}

    def rate(self, s, label):
        """Return cdot at ``label``, of a switching function of states."""
        rates, slopes = self._parts(s, label)
        return sum(g * r.value for g, r in zip(slopes, rates))

    def slope(self, s, other, label):
        """Return d cdot/d nu at ``label`` for the multiplier of ``other``; 0 if it is not determined by states and equations."""
        found = self._parts(s, label)
        slope = None if found is None else self._slope(label, other.nu[label], *found)
        return 0.0 if slope is None else slope

    def _parts(self, s, label):
        """The rates of the states in c, and the slopes of c along them; None if there are others than states in it."""
        variables = list(identify_variables(s.c[label], include_fixed=True))
        if not variables or any(v.parent_component() not in self._rates for v in variables):
            return None
        return [self._rates[v.parent_component()][v.index()] for v in variables], gradient(s.c[label], variables)

    def _slope(self, label, nu, rates, gradient):
        """sum_j gradient_j d rate_j/d nu by the implicit function theorem; None if the equations do not determine it.

        They do not where other variables are free, where other multipliers have to change with nu, and where a condition
        depends on the change: its active side may change too.
        """
        if label not in self._linear:
            self._linear[label] = self._linearised(label)
        columns, J, others = self._linear[label]
        if not columns:
            return 0.0
        right, wanted = np.zeros(J.shape[0]), np.zeros(J.shape[1])
        for row, entry in others.get(id(nu), ()):
            right[row] -= entry
        for rate, g in zip(rates, gradient):
            if rate in columns:
                wanted[columns[rate]] += g
        change, multipliers = _solve(J, right), _solve(J.T, wanted)
        if change is None or multipliers is None or self._reaches_conditions(label, columns, change):
            return None
        return float(multipliers @ right)

    def _reaches_conditions(self, label, columns, change):
        """Whether a side of a condition at ``label`` contains an unknown that changes."""
        sides = (side for c in self._conditions for side in c.sides.get(label, ()))
        found = (v for side in sides for v in identify_variables(side))
        largest = np.abs(change).max()
        return any(v in columns and abs(change[columns[v]]) > CHANGES * largest for v in found)

    def _linearised(self, label):
        """Columns and Jacobian of the unknowns in the equations at ``label``; by id, rows and entries of the other variables."""
        columns, entries, others, number = ComponentMap(), [], defaultdict(list), 0
        for c in (by_time[label] for by_time in self._families if label in by_time):
            if not (c.active and c.equality):
                continue
            variables = list(identify_variables(c.body))
            unknown = [self._unknown(v) for v in variables]
            if not any(unknown):
                continue
            for v, g, is_unknown in zip(variables, gradient(c.body, variables), unknown):
                if is_unknown:
                    entries.append((g, number, columns.setdefault(v, len(columns))))
                else:
                    others[id(v)].append((number, g))
            number += 1
        if not entries:
            return columns, None, others
        numbers, rows, cols = zip(*entries)
        return columns, csr_matrix((numbers, (rows, cols)), shape=(number, len(columns))), others

    def _unknown(self, v):
        component = v.parent_component()
        return component not in self._rates and v not in self._given and component not in self._given


def _solve(A, b):
    """A solution of A x = b, of least norm where the largest entry of each row and column is 1; None if there is none."""
    rows = _inverse(abs(A).max(axis=1))
    columns = _inverse(abs(diags(rows) @ A).max(axis=0))
    A, b = diags(rows) @ A @ diags(columns), rows * b
    x = lsqr(A, b, atol=EXACT, btol=EXACT)[0]
    return columns * x if np.abs(A @ x - b).max(initial=0.0) <= SOLVED * np.abs(b).max(initial=0.0) else None


def _inverse(largest):
    found = largest.toarray().ravel()
    return 1 / np.where(found > 0, found, 1.0)
