"""Logic between modes: combinations of modes that must not occur (theory, section 1).

Each Disjunction is in one mode at a time.  So the combinations of the modes that a LogicalConstraint speaks of can be gone
through, with Pyomo's own value of the expression for each.

    a mode that is in no allowed combination is switched off;
    modes i in A of one Disjunction and j in B of another that are in no allowed combination exclude one another:
        0 <= sum_A nu_i  perp  sum_B nu_j >= 0

A clause of two literals becomes one pair in this way, 0 <= 1 - l1 perp 1 - l2 >= 0, and so do several clauses whose combinations
form a rectangle.  Modes whose regions have no point in common get no pair: they exclude one another anyway.

Takes: the active LogicalConstraints over time whose literals are indicators of modes at the same time.
Leaves: ``exclusion`` (a Complementarity) for each LogicalConstraint with something left to say; the source is switched off.
Does not apply: where three or more modes exclude one another only all together.
"""

from dataclasses import dataclass
from itertools import combinations, compress, product
from math import prod

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, BooleanVar, LogicalConstraint, Set, value
from pyomo.core.expr.visitor import identify_variables, replace_expressions
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.dcs.regions import compatibility
from pyomo_fesd.errors import FesdError

#: More combinations of modes than this in one LogicalConstraint are not gone through.
MOST_COMBINATIONS = 10_000


@dataclass(frozen=True)
class Proposition:
    """What one LogicalConstraint says.

    Attributes
    ----------
    constraint : LogicalConstraintData
    trees : list of Tree
        the Disjunctions that it speaks of
    allowed : bool array
        which combinations of their modes it allows, one axis for each Disjunction
    """

    constraint: object
    trees: list
    allowed: np.ndarray

    def among(self, modes):
        """``allowed`` for the modes that are left, a dict by tree."""
        left = [[tree.modes.index(mode) for mode in modes[tree]] for tree in self.trees]
        table = self.allowed[np.ix_(*left)] if left else self.allowed
        if not table.any():
            raise FesdError(
                self.constraint,
                "it allows no combination of the modes that are left",
                "correct the logic, or switch on the modes that it needs",
            )
        return table


@dataclass(frozen=True)
class Exclusion:
    """Modes of two systems that exclude one another: ``((tree, mode numbers), (tree, mode numbers))``."""

    proposition: Proposition
    sides: tuple


def read_logic(blocks, trees, times):
    """The propositions of all active LogicalConstraints over time in ``blocks``.

    Raises
    ------
    FesdError
        for a BooleanVar over time that is no indicator, and for literals that are no modes of the same time
    """
    owners = ComponentMap((d.indicator_var, (tree, d)) for tree in trees for d in tree.disjuncts())
    found = []
    for block in blocks:
        _refuse_boolean_over_time(block, times)
        for constraint in block.component_data_objects(LogicalConstraint, active=True, descend_into=Block):
            if times.time(constraint) is not None:
                found.append(_read(constraint, owners, times))
    return found


def _refuse_boolean_over_time(block, times):
    for data in block.component_data_objects(BooleanVar, active=True, descend_into=Block):
        if times.time(data) is not None:
            raise FesdError(
                data,
                "a BooleanVar over time",
                "the state decides the mode: write logic between the indicators of the modes",
            )


def _read(constraint, owners, times):
    by_tree = {}
    for literal in ComponentSet(identify_variables(constraint.body, include_fixed=True)):
        _refuse_strange(literal, constraint, owners, times)
        if literal in owners:
            tree, disjunct = owners[literal]
            by_tree.setdefault(tree, []).append(disjunct)
    number = prod(len(tree.modes) for tree in by_tree)
    if number > MOST_COMBINATIONS:
        raise FesdError(constraint, f"it joins {number} combinations of modes", "split it into several LogicalConstraints")
    return Proposition(constraint, list(by_tree), _allowed(constraint.body, by_tree))


def _refuse_strange(literal, constraint, owners, times):
    """Literals are modes of the same time; a BooleanVar that is fixed is a constant."""
    if literal in owners:
        tree, _ = owners[literal]
        if times.time(tree.disjunction) == times.time(constraint):
            return
    elif literal.ctype is BooleanVar and literal.fixed:
        return
    raise FesdError(
        constraint,
        f"'{literal.name}' is not the indicator of a mode that is transformed with it at the same time",
        "let logic over time join indicators of one time; conditions on states belong into the regions of a Disjunction",
    )


def _allowed(expr, by_tree):
    """The value of ``expr`` for every combination of modes; the user's BooleanVars keep their values."""
    disjuncts = [d for of_tree in by_tree.values() for d in of_tree]
    stand_in = BooleanVar(range(len(disjuncts)))
    stand_in.construct()
    expr = replace_expressions(expr, {id(d.indicator_var): stand_in[k] for k, d in enumerate(disjuncts)})
    # modes that the expression does not tell apart need one evaluation only
    truths = [[tuple(d in mode for d in of_tree) for mode in tree.modes] for tree, of_tree in by_tree.items()]
    distinct = [list(dict.fromkeys(rows)) for rows in truths]
    table = np.empty([len(rows) for rows in distinct], dtype=bool)
    for position, combination in zip(np.ndindex(table.shape), product(*distinct)):
        for k, truth in enumerate(t for row in combination for t in row):
            stand_in[k].set_value(truth)
        table[position] = value(expr)
    return table[np.ix_(*([of.index(row) for row in rows] for of, rows in zip(distinct, truths)))] if by_tree else table


def modes_left(trees, propositions):
    """The modes that are in some combination which every proposition allows: a dict by tree."""
    modes, before = {tree: tree.modes for tree in trees}, None
    while modes != before:
        before = dict(modes)
        for proposition in propositions:
            table = proposition.among(modes)
            for axis, tree in enumerate(proposition.trees):
                modes[tree] = list(compress(modes[tree], _onto(table, axis)))
    return modes


def _onto(table, *axes):
    """Which entries along ``axes`` belong to some allowed combination."""
    return table.any(axis=tuple(a for a in range(table.ndim) if a not in axes))


def read_exclusions(propositions, systems):
    """What is left to impose on ``systems``: a list of Exclusion."""
    cache = {}
    return [exclusion for proposition in propositions for exclusion in _exclusions(proposition, systems, cache)]


def _exclusions(proposition, systems, cache):
    involved = [system for tree in proposition.trees for system in systems if system.tree is tree]
    table = proposition.among({system.tree: system.modes for system in involved})
    possible = compatibility(proposition.constraint, [system.regions for system in involved], cache)
    _refuse_larger(proposition.constraint, involved, table, possible)
    for a, b in combinations(range(table.ndim), 2):
        excluded = ~_onto(table, a, b)
        for i, j in np.argwhere(excluded):
            excluded[i, j] = possible({a: i, b: j})
        for of_a, of_b in _rectangles(excluded):
            yield Exclusion(proposition, ((involved[a].tree, of_a), (involved[b].tree, of_b)))


def _refuse_larger(constraint, systems, table, possible):
    """Refuse combinations of three and more modes of which each two are allowed."""
    left = ~table
    for a, b in combinations(range(table.ndim), 2):
        left = left & np.expand_dims(_onto(table, a, b), tuple(k for k in range(table.ndim) if k not in (a, b)))
    for combination in np.argwhere(left):
        if possible(dict(enumerate(combination))):
            names = ', '.join(f"'{system.modes[i].name}'" for system, i in zip(systems, combination))
            raise FesdError(
                constraint,
                f"it excludes the modes {names} only all together",
                "exclude two modes at a time, or write the modes of these Disjunctions as those of one Disjunction",
            )


def _rectangles(excluded):
    """Row and column numbers whose products make up the true entries: by equal rows or by equal columns, what takes fewer."""
    by_rows, by_columns = _equal_rows(excluded), [(rows, columns) for columns, rows in _equal_rows(excluded.T)]
    return min(by_rows, by_columns, key=len)


def _equal_rows(matrix):
    groups = {}
    for k, row in enumerate(matrix):
        groups.setdefault(tuple(np.flatnonzero(row).tolist()), []).append(k)
    return [(rows, list(columns)) for columns, rows in groups.items() if columns]


def replace_logic(home, proposition, exclusions, weights):
    """Put the pairs of one LogicalConstraint on the block ``home`` beside it, and switch it off.

    Parameters
    ----------
    exclusions : list of Exclusion
        those of all propositions
    weights : dict Tree -> callable
        gives the sum of the multipliers of some modes of a system, by their numbers
    """
    constraint = proposition.constraint
    index = constraint.index()
    index = () if index is None else index if isinstance(index, tuple) else (index,)
    own = [exclusion for exclusion in exclusions if exclusion.proposition is proposition]
    for number, exclusion in enumerate(own, start=1):
        block = _block(home, constraint.parent_component())
        block.numbers.add(number)
        G, H = (weights[tree](modes) for tree, modes in exclusion.sides)
        pair = block.exclusion.add((*index, number), complements(G >= 0, H >= 0))
        block.private_data('pyomo_fesd.dcs').sources[pair] = [constraint]
    marks.mark(home, marks.REPLACED, constraint)
    constraint.deactivate()


def _block(home, component):
    """The block for all times of one LogicalConstraint; made at its first time."""
    block = home.component(component.local_name)
    if block is None:
        block = Block()
        home.add_component(component.local_name, block)
        block.numbers = Set(dimen=1)
        block.exclusion = Complementarity(*((component.index_set(),) if component.is_indexed() else ()), block.numbers)
    return block
