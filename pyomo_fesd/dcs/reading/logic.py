"""Logic between modes: the combinations of modes that a LogicalConstraint allows (theory, section 1).

Each Disjunction is in one mode at a time.  So every combination of the modes in a LogicalConstraint is evaluated, with Pyomo's own
value of the expression.  A mode that is in no allowed combination is deactivated; ``exclusions.py`` makes pairs of the rest.

Takes: the active LogicalConstraints over time whose literals are indicators of modes at the same time.
Leaves: a ``Proposition`` for each; nothing on the model.
Does not apply: to conditions on states, which are regions of a Disjunction.
"""

from dataclasses import dataclass
from itertools import chain, compress, product
from math import prod
from typing import Any

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, BooleanVar, LogicalConstraint, value
from pyomo.core.expr.visitor import identify_variables, replace_expressions

from pyomo_fesd.core import FesdError

#: More combinations of modes than this in one LogicalConstraint are not evaluated.
MOST_COMBINATIONS = 10_000


@dataclass(frozen=True)
class Proposition:
    """One LogicalConstraint as a table over the modes of its Disjunctions.

    Attributes
    ----------
    constraint : LogicalConstraintData
    trees : list of DisjunctionTree
        the Disjunctions whose modes it contains
    allowed : bool array
        True for each combination of their modes that it allows, one axis for each Disjunction
    """

    constraint: Any
    trees: list
    allowed: np.ndarray

    def among(self, modes: dict) -> np.ndarray:
        """Return ``allowed`` for the modes that are left, a dict by tree."""
        left = [[tree.modes.index(mode) for mode in modes[tree]] for tree in self.trees]
        table = self.allowed[np.ix_(*left)] if left else self.allowed
        if not table.any():
            raise FesdError(
                self.constraint,
                "it allows no combination of the modes that are left",
                "correct the logic, or switch on the modes that it needs",
            )
        return table


def read_logic(blocks, trees, times) -> list[Proposition]:
    """Return the propositions of all active LogicalConstraints over time in ``blocks``.

    Raises
    ------
    FesdError
        for a BooleanVar over time other than an indicator, and for literals other than modes of the same time
    """
    constraints = [constraint for block in blocks for constraint in _constraints_over_time(block, times)]
    if not constraints:
        return []
    owners = ComponentMap((d.indicator_var, (tree, d)) for tree in trees for d in tree.disjuncts())
    return [_read_proposition(constraint, owners, times) for constraint in constraints]


def _constraints_over_time(block, times):
    _refuse_boolean_over_time(block, times)
    found = block.component_data_objects(LogicalConstraint, active=True, descend_into=Block)
    return [constraint for constraint in found if times.time(constraint) is not None]


def _refuse_boolean_over_time(block, times):
    for data in block.component_data_objects(BooleanVar, active=True, descend_into=Block):
        if times.time(data) is not None:
            raise FesdError(
                data,
                "a BooleanVar over time",
                "the state decides the mode: write logic between the indicators of the modes",
            )


def _read_proposition(constraint, owners, times):
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
    """Refuse literals other than modes of the same time and fixed BooleanVars, which are constants."""
    if literal in owners:
        tree, _ = owners[literal]
        if times.time(tree.disjunction) == times.time(constraint):
            return
    elif literal.ctype is BooleanVar and literal.fixed:
        return
    raise FesdError(
        constraint,
        f"'{literal.name}' is not the indicator of a mode that is transformed with it at the same time",
        "write logic over time between indicators of one time, and conditions on states as regions of a Disjunction",
    )


def _allowed(expr, by_tree):
    """The value of ``expr`` for every combination of modes; the user's BooleanVars keep their values."""
    expr, literals = _with_own_literals(expr, list(chain(*by_tree.values())))
    # modes with the same truth values of the literals need one evaluation only
    truths = [[tuple(d in mode for d in of_tree) for mode in tree.modes] for tree, of_tree in by_tree.items()]
    distinct = [list(dict.fromkeys(rows)) for rows in truths]
    values = [_value(expr, literals, chain(*combination)) for combination in product(*distinct)]
    table = np.array(values, dtype=bool).reshape([len(rows) for rows in distinct])
    positions = [[rows.index(row) for row in of_tree] for rows, of_tree in zip(distinct, truths)]
    return table[np.ix_(*positions)] if by_tree else table


def _with_own_literals(expr, disjuncts):
    literals = BooleanVar(range(len(disjuncts)))
    literals.construct()
    return replace_expressions(expr, {id(d.indicator_var): literals[k] for k, d in enumerate(disjuncts)}), literals


def _value(expr, literals, truths):
    for k, truth in enumerate(truths):
        literals[k].set_value(truth)
    return value(expr)


def modes_left(trees, propositions) -> dict:
    """Return the modes of each tree that are in some combination allowed by every proposition."""
    modes, before = {tree: tree.modes for tree in trees}, None
    while modes != before:
        before = dict(modes)
        for proposition in propositions:
            table = proposition.among(modes)
            for axis, tree in enumerate(proposition.trees):
                modes[tree] = list(compress(modes[tree], allowed_along(table, axis)))
    return modes


def allowed_along(table, *axes) -> np.ndarray:
    """Return True for the entries along ``axes`` that belong to some allowed combination."""
    return table.any(axis=tuple(a for a in range(table.ndim) if a not in axes))
