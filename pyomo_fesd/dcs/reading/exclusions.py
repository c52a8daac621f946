"""Pairs of modes of two Disjunctions that exclude one another (theory, section 1).

Modes i in A of one Disjunction and j in B of another that are in no allowed combination exclude one another:

    0 <= sum_A nu_i  perp  sum_B nu_j >= 0

A clause of two literals becomes one pair in this way, 0 <= 1 - l1 perp 1 - l2 >= 0, and so do several clauses whose combinations
form a rectangle.  Modes whose regions have no common point get no pair: they exclude one another anyway.

Takes: propositions, and the systems with the modes that are left.
Leaves: a list of ``Exclusion``; ``dcs/exclusion_pairs.py`` writes them.
Does not apply: where three or more modes exclude one another only all together.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pyomo_fesd.core import FesdError
from pyomo_fesd.dcs.reading.logic import Proposition, allowed_along
from pyomo_fesd.dcs.reading.regions import compatibility


@dataclass(frozen=True)
class Exclusion:
    """Modes of two systems that exclude one another: ``((tree, mode numbers), (tree, mode numbers))``."""

    proposition: Proposition
    sides: tuple


def read_exclusions(propositions, systems) -> list[Exclusion]:
    """Return the exclusions that the propositions impose on ``systems``."""
    cache = {}
    return [exclusion for proposition in propositions for exclusion in _exclusions(proposition, systems, cache)]


def _exclusions(proposition, systems, cache):
    involved = [system for tree in proposition.trees for system in systems if system.tree is tree]
    table = proposition.among({system.tree: system.modes for system in involved})
    possible = compatibility(proposition.constraint, [system.regions for system in involved], cache)
    _refuse_larger(proposition.constraint, involved, table, possible)
    for a, b in combinations(range(table.ndim), 2):
        excluded = ~allowed_along(table, a, b)
        for i, j in np.argwhere(excluded):
            excluded[i, j] = possible({a: i, b: j})
        for of_a, of_b in _rectangles(excluded):
            yield Exclusion(proposition, ((involved[a].tree, of_a), (involved[b].tree, of_b)))


def _refuse_larger(constraint, systems, table, possible):
    """Refuse combinations of three and more modes of which each two are allowed."""
    left = ~table
    for a, b in combinations(range(table.ndim), 2):
        left = left & np.expand_dims(allowed_along(table, a, b), tuple(k for k in range(table.ndim) if k not in (a, b)))
    for combination in np.argwhere(left):
        if possible(dict(enumerate(combination))):
            names = ', '.join(f"'{system.modes[i].name}'" for system, i in zip(systems, combination))
            raise FesdError(
                constraint,
                f"it excludes the modes {names} only all together",
                "exclude two modes at a time, or write the modes of these Disjunctions as those of one Disjunction",
            )


def _rectangles(excluded):
    """Row and column numbers whose products make up the true entries: by equal rows or by equal columns, whichever are fewer."""
    by_rows, by_columns = _equal_rows(excluded), [(rows, columns) for columns, rows in _equal_rows(excluded.T)]
    return min(by_rows, by_columns, key=len)


def _equal_rows(matrix):
    groups = {}
    for k, row in enumerate(matrix):
        groups.setdefault(tuple(np.flatnonzero(row).tolist()), []).append(k)
    return [(rows, list(columns)) for columns, rows in groups.items() if columns]
